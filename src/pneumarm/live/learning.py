"""Making a controller while people look on: the whole job, with the arm, the progress and the figures on the page."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import Arm
from pneumarm.arm.seam import Reading
from pneumarm.arm.wrapper import ArmWrapper
from pneumarm.errors import PneumarmError
from pneumarm.live.screen import Screen
from pneumarm.progress import Report, compiling
from pneumarm.run import Run, RunSettings, RunTransferSettings

TRANSITIONS = 36_000
"""How much is recorded: 20 minutes of an arm that is controlled at 30 Hz."""
TRANSFER = RunTransferSettings(episodes=100, test_episodes=50)
"""Few movements: people are looking on."""
REPORT = "report"
"""The last stage, which leaves a page and no results."""
STAGES = {
    "collect": "move about and record",
    "simulation": "learn a simulation from the recording",
    "training": "learn a controller in the simulation",
    "test": "try it in the simulation",
    "transfer": "move it onto the arm and adapt",
    "settle": "move to goals and hold them",
    REPORT: "write the report",
}
"""Stages of the job by the name of their results, in words."""
_TELL = 0.2  # s between two tellings


class LeftOff(PneumarmError):  # noqa: N818 - reads as a sentence where it is raised
    """Somebody stopped the learning; what was recorded so far is kept."""


class Watched(ArmWrapper):
    """An arm whose readings are shown on the page, and that stops when somebody wants that."""

    def __init__(self, arm: Arm, screen: Screen, check: Callable[[], None]) -> None:
        super().__init__(arm)
        self._screen, self._check = screen, check
        self._command: NDArray[Any] = np.zeros((arm.spec.joints, 2), np.int8)

    def read(self) -> Reading:
        """Return what the sensors say, and show it.

        Raises:
            LeftOff: somebody wants it to stop.

        """
        self._check()
        reading = self.arm.read()
        self._screen.show(self.spec, reading, None, self._command)
        return reading

    def set_valves(self, valves: NDArray[np.int8]) -> None:
        """Set the valves."""
        self._command = valves
        self.arm.set_valves(valves)

    def set_pulses(self, command: NDArray[np.float64]) -> bool:
        """Set pulses, if the arm can time them."""
        self._command = command
        return self.arm.set_pulses(command)


class Learning:
    """A run that people look at: its stages, what is done of the present one, and their figures are told.

    Args:
        folder: of the run, which is begun or gone on with.
        settings: of one that is begun.
        screen: where it is told.
        stopped: whether somebody wants it to stop.

    """

    def __init__(self, folder: Path, settings: RunSettings, screen: Screen, stopped: Callable[[], bool]) -> None:
        self._screen, self._stopped = screen, stopped
        self._begun = monotonic()
        self._at = "", 0.0, 0.0  # what is being done, how much of it is done, and the total
        self._run = Run(folder, settings, self._progress, self._watched)

    def do(self) -> None:
        """Do all stages that are not done yet.

        Raises:
            LeftOff: somebody stopped it.

        """
        compiling.watch()
        with self._telling():
            self._run.do()
        self._tell(done=True)

    def _watched(self, arm: Arm) -> Arm:
        return Watched(arm, self._screen, self._check)

    def _check(self) -> None:
        if self._stopped():
            raise LeftOff("the learning was stopped; what was recorded so far is kept")

    @contextmanager
    def _progress(self, title: str) -> Iterator[Report]:
        def report(done: float, total: float) -> None:
            self._check()
            self._at = title, done, total

        self._at = title, 0.0, 0.0
        yield report
        self._at = "", 0.0, 0.0

    @contextmanager
    def _telling(self) -> Iterator[None]:
        """Tell how far it is from a thread of its own: what compiles or fits says nothing for a while."""
        over = Event()

        def go_on() -> None:
            while not over.wait(_TELL):
                self._tell()

        self._tell()
        telling = Thread(target=go_on, name="learning", daemon=True)
        telling.start()
        try:
            yield
        finally:
            over.set()
            telling.join()

    def _tell(self, done: bool = False) -> None:
        """Tell what is being done, how far it is, and what came of the stages before; or that all is ``done``."""
        title, so_far, total = self._at
        results = dict(self._run.results)
        if done:
            results[REPORT] = {}
        now = next((name for name in STAGES if name not in results), REPORT)
        self._screen.tell(
            learning={
                "seconds": round(monotonic() - self._begun),
                "title": title,
                "compiling": compiling.now,
                "stopping": self._stopped(),
                "share": so_far / total if total else None,
                "done": done,
                "report": str(self._run.folder / "report.html"),
                "stages": [
                    {
                        "words": words,
                        "state": "done" if name in results else "now" if name == now else "to come",
                        "figures": figures_of(name, results) if name in results else "",
                    }
                    for name, words in STAGES.items()
                ],
            }
        )


def figures_of(stage: str, results: dict[str, Any]) -> str:
    """Return in words what came of a ``stage`` that is done."""
    found = results[stage]
    if stage == REPORT:
        return ""
    if stage == "collect":
        return f"{found['transitions']:,} readings, {found['seconds'] / 60:.0f} min of the arm's time"
    if stage == "simulation":
        error = found.get("relative_error", {}).get("angle")
        error = float(np.mean(error)) if error is not None else None
        return "" if error is None else f"it predicts the angle with an error of {error:.0%} of its change"
    if stage == "training":
        return f"{found['episodes']:,} movements in {found['seconds']:.0f} s"
    if stage == "test":
        return f"reaches {found['success_rate']:.1%} of its goals"
    if stage == "transfer":
        return f"reaches {found['before']['success_rate']:.0%} on arrival, {found['after']['success_rate']:.0%} after"
    if not found:
        return ""
    median = "" if found["median_seconds"] is None else f", median {found['median_seconds']:.2f} s"
    return f"settles at {found['settled']:.0%} within {found['tolerance_deg']:g}°{median}"
