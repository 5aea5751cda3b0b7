"""No simulation (sections 4.3.3, 5.5): how long must an agent learn on the arm itself?

The thesis guesses 29 h from 15,000 movements of 7.05 s. Here one agent learns on the arm from scratch: first the arm
visits random begin states, which tell the range of goals and how to scale what is read; then the deviation is shaped
as in the simulation, but the other way around (section 4.3.3): the arm goes to a random begin state and the goal is
set close to it. Time is the arm's: venting, inflating and waiting count. The end is the criterion of section 5.2.
Beside it an agent from the same weights, trained in the simulation, whose collecting took arm time too.

Numbered differences from the thesis:

1. The thesis does not say how goals are drawn around a begin state: here by the weights of the sub-intervals of
   section 4.3.2, mirrored, within the range of goals.
2. Nor how readings are scaled without recorded transitions: by the mean and two standard deviations of the states
   visited at rest; velocities by five times the tolerance of eq. 5.2.
3. Goals are in the middle 80 % of the range between the ends that the arm reaches at rest.

    pneumarm experiment on-the-arm-only
"""

from pneumarm.experiments.on_the_arm_only.from_scratch import OnTheArmOnly

EXPERIMENT = OnTheArmOnly()
