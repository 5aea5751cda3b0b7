"""How many transitions do two joints need, and how much worse is their simulation (sections 6.1.1 and 6.1.4)?

The thesis feared that the transitions of one joint would have to be squared, found that twice as many, 400,000, were
enough, and the simulation a bit worse. Factor: the transitions; from each number a simulation is fitted, in which a
policy learns all goals, and the policy moves the arm. The last trial is the simulation of an arm of one joint with
the same seed; it is there for virtual arms alone. ``joint-data-long`` has the thesis' own sizes.

    pneumarm experiment joint-data --out laboratory
"""

from pneumarm.experiments.joint_data.transitions import joint_data

EXPERIMENT = joint_data("joint-data", 3_000, 6_000, 12_000, 24_000)
