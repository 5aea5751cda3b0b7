"""Does exploring by each of two agents make it harder to learn together (section 6.1.3)?

Where both explore with a probability of 0.5, at least one does with 0.75. The thesis proposes a lower rate, or a less
demanding criterion. The thesis' agents learn one goal, that in the middle, with its shaping, with the rates at which
one of two explores with 0.5, with a low rate, with half the criterion at the beginning, and without shaping.

    pneumarm experiment joint-exploration --out laboratory
"""

from pneumarm.experiments.joint_exploration.rates import VARIED, JointExploration
from pneumarm.experiments.several_joints import THESIS, Lesson
from pneumarm.experiments.trainings import with_settings
from pneumarm.experiments.words import words_of

EXPERIMENT = JointExploration(
    name="joint-exploration",
    words=words_of(__name__),
    lessons={words: Lesson(with_settings(THESIS, changes), goals="middle") for words, changes in VARIED.items()},
)
