"""Is one pair of goal angles learnable, and are all at once (section 6.1.4)?

The thesis learned a single goal of two joints in about 100,000 episodes and left open whether all can be learned at
once: that depends on the function approximator. Trials are the thesis' agents, one a joint with a common goal, and a
policy learned in many simulated arms; each learns the goal in the middle, a goal that is drawn anew for each arm, and
all goals that the arm can hold. Each is tested from all begin states.

    pneumarm experiment goal-pairs --out laboratory
"""

from collections.abc import Mapping
from typing import Literal

from pneumarm.experiments.several_joints import POLICY, THESIS, Lesson, SeveralJoints
from pneumarm.experiments.words import words_of

_GOALS: Mapping[str, Literal["all", "one", "middle"]] = {"middle goal": "middle", "a goal": "one", "all goals": "all"}

EXPERIMENT = SeveralJoints(
    name="goal-pairs",
    words=words_of(__name__),
    lessons={
        f"{who}, {what}": Lesson(learning, goals=goals)
        for who, learning in (("thesis' agents", THESIS), ("policy", POLICY))
        for what, goals in _GOALS.items()
    },
)
