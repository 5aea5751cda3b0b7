"""What an experiment is: trials as data, a measurement of one trial in one run, and an analysis of the rows."""

import importlib
import importlib.util
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.errors import UnusableInput
from pneumarm.experiments.verdict import Criterion, Interval, Judgement, Verdict
from pneumarm.experiments.words import Words
from pneumarm.progress import Report
from pneumarm.settings import NonNegativeInt, PositiveInt, Settings

if TYPE_CHECKING:
    from pneumarm.report.page import Section

Figures = Mapping[str, float]
"""What was measured, by name."""
ARMS = tuple(f"virtual:seed={number}" for number in range(1, 6))
"""Five different arms to develop on; those to judge on are ``virtual:seed=1001`` to ``1010``."""


@dataclass(frozen=True)
class LaboratorySettings(Settings):
    """What decides the rows of an experiment, besides the experiment itself. More arms and runs only add rows."""

    seed: NonNegativeInt = 0
    """Random seed."""
    transitions: int = 200_000
    """How many to collect on each arm (thesis section 3.2.2: 200,000, two hours)."""
    test_episodes: PositiveInt = 10_000
    """Greedy movements that every agent is tested with (thesis section 5.2)."""
    max_episodes: PositiveInt | None = None
    """Training episodes at most; otherwise as many as the experiment says."""
    collecting: Literal["thesis", "ours"] = "thesis"
    """How arms are recorded: as in the thesis, or with lean sequences and begin states by this arm's own times."""
    exploring: bool = False
    """Test every agent a second time, exploring as when its training ended; that takes as long as training it."""


class Row(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What one trial gave in one run on one arm."""

    arm: str
    trial: int
    """Number, from 1."""
    run: int
    """Number, from 1."""
    figures: dict[str, float]
    seconds: float
    """Time that it took [s]."""

    @property
    def key(self) -> tuple[str, int, int]:
        """What identifies the row."""
        return self.arm, self.trial, self.run


@dataclass(frozen=True)
class TrialRows:
    """The rows of an experiment, sorted by arm, trial and run."""

    rows: tuple[Row, ...]

    @cached_property
    def by_key(self) -> Mapping[tuple[str, int, int], Row]:
        """Rows by what identifies them."""
        return {row.key: row for row in self.rows}

    @cached_property
    def arms(self) -> tuple[str, ...]:
        """Arms in the order of their names."""
        return tuple(sorted({row.arm for row in self.rows}))

    @property
    def figures(self) -> frozenset[str]:
        """Names of the figures that every row has."""
        return frozenset.intersection(*(frozenset(row.figures) for row in self.rows)) if self.rows else frozenset()

    def of(self, trials: Iterable[int]) -> "TrialRows":
        """Return the rows of ``trials`` alone."""
        wanted = set(trials)
        return TrialRows(tuple(row for row in self.rows if row.trial in wanted))

    @cached_property
    def runs(self) -> int:
        """Highest number of a run."""
        return max((row.run for row in self.rows), default=0)

    def table(self, figure: str, trials: Sequence[int], arm: str | None = None) -> NDArray[np.float64]:
        """Return ``figure`` by trial and run, shape (trials, runs); the runs of several arms side by side.

        Raises:
            UnusableInput: a row is missing, because the sweep is not finished.

        """
        arms = self.arms if arm is None else (arm,)
        found = self.by_key
        keys = [[(a, t, r) for a in arms for r in range(1, self.runs + 1)] for t in trials]
        missing = [key for line in keys for key in line if key not in found]
        if missing:
            raise UnusableInput(f"{len(missing)} rows are missing, the first is {missing[0]}; finish the sweep first")
        return np.array([[found[key].figures[figure] for key in line] for line in keys])

    def pooled(self, figure: str, trials: Sequence[int]) -> NDArray[np.float64]:
        """Return ``figure`` of all ``trials``, those of each arm side by side, shape (arms, trials times runs)."""
        return np.stack([self.table(figure, trials, arm).ravel() for arm in self.arms])


@dataclass(frozen=True)
class Claim:
    """Something that the thesis says, next to what was found here."""

    text: str
    thesis: str
    """The thesis' evidence."""
    ours: str
    """Ours, with an interval where there is one."""
    about: str
    """Which of the thesis' conclusions it is about, by its key in ``claims/conclusions.toml``."""
    criterion: Criterion
    """What was stated of it beforehand."""
    found: Mapping[str, Any]
    """What it is judged by."""

    @cached_property
    def judgement(self) -> Judgement:
        """What its criterion makes of what was found."""
        return self.criterion.judge(self.found)

    @property
    def verdict(self) -> Verdict:
        """Whether it holds."""
        return self.judgement.verdict

    @property
    def short(self) -> str:
        """Its verdict, and how many arms would decide it."""
        arms = self.judgement.arms
        return f"{self.verdict} ({arms:,} arms would)" if arms else self.verdict

    @property
    def explained(self) -> str:
        """Its verdict with its reason."""
        return f"{self.verdict}: {self.judgement.why}" if self.judgement.why else self.verdict

    @property
    def medians(self) -> str:
        """What the medians of the runs say in place of their means, for people."""
        found = [self.found[name] for name in self.criterion.names]
        return "; ".join(str(one.median) for one in found if isinstance(one, Interval) and one.median)


def claims_of(words: Words, found: Mapping[str, Any]) -> tuple[Claim, ...]:
    """Return the claims of ``words`` that are filled with what was ``found``."""
    named = ((about, one) for about, claims in words.claims.items() for one in claims)
    return tuple(Claim(one.claim, one.thesis, one.ours, about, one.stated, found) for about, one in named)


@dataclass(frozen=True)
class Analysis:
    """What an experiment says."""

    summary: Sequence[str]
    """Paragraphs."""
    figures: Mapping[str, Any]
    """For programs: what ``results.json`` holds."""
    sections: Sequence["Section"]
    """Sections of the page."""
    claims: Sequence[Claim] = field(default=())


class Axis(NamedTuple):
    """Trials in the order of a quantity."""

    label: str
    """Name of the quantity, with its unit."""
    places: Sequence[float]
    """Places of the trials, from left to right."""
    ticks: Sequence[str] | None = None
    """What is written there; by default the places."""
    log: bool = False


class Experiment(ABC):
    """An experiment of the laboratory. It is sent to other processes, so it must be data."""

    name: str
    """On the command line."""
    words: Words
    runs: int = 4
    """Default number of runs."""
    arms: tuple[str, ...] = ARMS
    """Default arms."""
    records: ClassVar[bool] = False
    """Whether it is prepared by recording the arm, as :func:`pneumarm.experiments.preparation.simulated` does."""

    @property
    @abstractmethod
    def trials(self) -> Mapping[int, str]:
        """Trials by number, in words."""

    @abstractmethod
    def settings(self) -> Any:
        """Return what decides the rows, as JSON: a folder is gone on with only where it is the same."""

    @abstractmethod
    def prepare(self, arm: str, folder: Path, settings: LaboratorySettings, progress: Report) -> Any:
        """Return what :meth:`measure` needs of ``arm``, making it in ``folder`` where it is missing.

        ``folder`` belongs to the arm and is shared by all experiments of a laboratory. What is returned goes to
        other processes, perhaps on other machines: let it be data rather than paths.
        """

    @abstractmethod
    def measure(self, material: Any, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Return the figures of ``trial`` in ``run``. The same arguments give the same figures, bit for bit."""

    def movements(self, trial: int, arm: str, settings: LaboratorySettings) -> int:
        """Return how many movements :meth:`measure` makes on ``arm`` at most, as far as that is known before."""
        return 0

    def rest(self, trial: int) -> float:
        """Return for how long the arm is left alone meanwhile [s]."""
        return 0.0

    @property
    def axis(self) -> Axis | None:
        """Axis along which pictures have the first trials of a section, if there is one."""
        return None

    def analyse(self, rows: TrialRows) -> Analysis:
        """Return what the complete ``rows`` say; runs nothing.

        The module ``analysis`` in the experiment's folder knows, if it has one, otherwise the common one. It is
        imported here, so that processes that compute rows need no pictures.
        """
        own = f"{type(self).__module__.rpartition('.')[0]}.analysis"
        place = own if importlib.util.find_spec(own) else "pneumarm.experiments.analysis"
        found: Analysis = importlib.import_module(place).analysis(self, rows)
        return found


def run_seed(settings: LaboratorySettings, run: int) -> int:
    """Return the seed that all trials of ``run`` share, so that they begin with the same weights (section 5.3).

    It is the same in all experiments, so that run 1 of one can be compared with run 1 of another.
    """
    return int(np.random.SeedSequence([settings.seed, run]).generate_state(1)[0])


def sorted_rows(rows: Iterable[Row]) -> TrialRows:
    """Return ``rows`` in their order."""
    return TrialRows(tuple(sorted(rows, key=lambda row: row.key)))
