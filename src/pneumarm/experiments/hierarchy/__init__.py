"""Does an upper agent that sets subgoals help (section 6.2)?

The thesis proposes it and did not try. An upper agent sets each joint an angle on the way to its goal, lower ones,
one a joint with the thesis' networks, hold the valves; they are paid for their subgoals, and besides for the goal of
both. The upper agent sees angles and goals alone, as [15] asks for, or all that the lower agents see. Flat agents,
with a common goal and with goals of their own, have as many episodes at most. One goal, that in the middle, and all
goals are learned.

    pneumarm experiment hierarchy --out laboratory
"""

from dataclasses import fields, replace

from pneumarm.experiments.several_joints import HALF_AS_LONG, Lesson, SeveralJoints
from pneumarm.experiments.words import words_of
from pneumarm.learning.hierarchy import HierarchySettings

_METHOD = "pneumarm.learning.hierarchy:HIERARCHY"
_UPPER = HierarchySettings(
    **{field.name: getattr(HALF_AS_LONG, field.name) for field in fields(HALF_AS_LONG) if field.name != "team"}
)
_AGENTS = {
    "flat, common goal": Lesson(HALF_AS_LONG),
    "flat, own goals": Lesson(replace(HALF_AS_LONG, team="own")),
    "upper agent sees angles": Lesson(_UPPER, _METHOD),
    "upper agent sees all": Lesson(replace(_UPPER, upper_state="whole"), _METHOD),
}

EXPERIMENT = SeveralJoints(
    name="hierarchy",
    words=words_of(__name__),
    lessons={
        f"{who}, {what}": replace(lesson, goals="middle" if what == "one goal" else "all")
        for what in ("one goal", "all goals")
        for who, lesson in _AGENTS.items()
    },
)
