"""The experiment ``joint-data`` with the thesis' own sizes, 200,000 and 400,000 transitions (section 6.1.4).

Collecting these takes hours of an arm's time, and minutes of a virtual one's.

    pneumarm experiment joint-data-long --out laboratory
"""

from pneumarm.experiments.joint_data.transitions import joint_data

EXPERIMENT = joint_data("joint-data-long", 36_000, 100_000, 200_000, 400_000)
