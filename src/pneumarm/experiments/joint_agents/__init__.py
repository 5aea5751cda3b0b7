"""Who should act for two joints: agents with a common goal, with goals of their own, or one for both (section 6.1.2)?

The thesis takes an agent a joint with a common goal, expects the best results of that, and thinks one agent with 81
actions impossible. These three, with its networks and its shaping, and a policy whose joints choose independently
given the state, each learn one goal, that in the middle, and all goals. Whoever learns, a movement succeeds where
both joints are at their goals at once.

    pneumarm experiment joint-agents --out laboratory
"""

from dataclasses import replace
from typing import Any

from pneumarm.experiments.several_joints import HALF_AS_LONG, POLICY, Lesson, SeveralJoints
from pneumarm.experiments.words import words_of

_TEAMS: dict[str, Any] = {
    "common goal": HALF_AS_LONG,
    "own goals": replace(HALF_AS_LONG, team="own"),
    "one agent": replace(HALF_AS_LONG, team="one"),
    "policy": POLICY,
}

EXPERIMENT = SeveralJoints(
    name="joint-agents",
    words=words_of(__name__),
    lessons={
        f"{who}, {what}": Lesson(learning, goals="middle" if what == "one goal" else "all")
        for what in ("one goal", "all goals")
        for who, learning in _TEAMS.items()
    },
)
