"""What was counted while an arm moved: what the guard did, missed periods, and what happened on the link."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Self

from pneumarm.arm.cycle import ControlCycle
from pneumarm.arm.guard import Interventions


@dataclass(frozen=True)
class Counts:
    """Counts of some stretch of time; those of stretches that follow on each other can be added."""

    interventions: Interventions = field(default_factory=Interventions)
    """How often the guard did what."""
    missed_deadlines: int = 0
    """Points of the grid of control periods that passed without a turn within half a period."""
    link: Mapping[str, int] = field(default_factory=dict)
    """What happened on the link to the arm, by name; empty for an arm without one."""

    @classmethod
    def now(cls, cycle: ControlCycle) -> Self:
        """Return what ``cycle`` and the arm behind it have counted until now."""
        return cls(cycle.arm.interventions, cycle.missed_deadlines, cycle.arm.link_counts())

    @classmethod
    def of(cls, saved: Mapping[str, Any]) -> Self:
        """Return what :meth:`as_dict` gave."""
        return cls(Interventions(**saved["interventions"]), int(saved["missed_deadlines"]), dict(saved["link"]))

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain numbers by name."""
        return asdict(self)

    def __add__(self, other: "Counts") -> "Counts":
        return Counts(
            self.interventions + other.interventions,
            self.missed_deadlines + other.missed_deadlines,
            {name: self.link.get(name, 0) + other.link.get(name, 0) for name in {**self.link, **other.link}},
        )

    def __sub__(self, other: "Counts") -> "Counts":
        return self + Counts(
            Interventions() - other.interventions,
            -other.missed_deadlines,
            {name: -count for name, count in other.link.items()},
        )
