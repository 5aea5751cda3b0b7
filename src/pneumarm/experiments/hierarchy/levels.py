"""Flat agents, and such with an upper one."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

from pneumarm.experiments.several_joints import Lesson, SeveralJoints
from pneumarm.experiments.words import words_of
from pneumarm.learning.hierarchy import HierarchySettings

METHOD = "pneumarm.learning.hierarchy:HIERARCHY"
WHO = ("flat, common goal", "flat, own goals", "upper agent sees angles", "upper agent sees all")


@dataclass(frozen=True)
class Levels(SeveralJoints):
    """Flat and hierarchical agents, each with one goal and with all."""

    episodes: int = 50_000
    """Of each, at most: half of what the thesis needed for a single goal."""
    name = "hierarchy"
    words = words_of(__package__)

    @property
    def lessons(self) -> Mapping[str, Lesson]:
        """By what is learned and who learns."""
        thesis = replace(self.thesis, max_episodes=self.episodes)
        alike = {field.name: getattr(thesis, field.name) for field in fields(thesis) if field.name != "team"}
        upper = HierarchySettings(**alike)
        who = (
            Lesson(thesis),
            Lesson(replace(thesis, team="own")),
            Lesson(upper, METHOD),
            Lesson(replace(upper, upper_state="whole"), METHOD),
        )
        return {
            f"{called}, {what}": replace(lesson, goals="middle" if what == "one goal" else "all")
            for what in ("one goal", "all goals")
            for called, lesson in zip(WHO, who, strict=True)
        }
