"""Noticing that an arm is no longer as its simulation says, from what the simulation predicts wrongly.

    x_m = mean over the steps of movement m of (residue / error_std)^2,   cut at c      one for each quantity
    S_m = max(0, S_{m-1} + x_m - a),   S_0 = 0                            alarm when one of them exceeds h

``error_std`` is the error of the simulation on transitions that it was not fitted to, so that x is about 1 on an arm
that is as it was. A cumulative sum weighs all movements since it was last 0, which is where the change began, and
notices a large change after few of them and a small one after many (E. S. Page, "Continuous inspection schemes",
Biometrika 41, 1954). Cutting x keeps one odd movement from raising an alarm.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike, NDArray

from pneumarm.errors import UnusableInput
from pneumarm.settings import PositiveFloat, PositiveInt, Settings, Valid
from pneumarm.simulation.quality import residue
from pneumarm.simulation.simulation import Simulation
from pneumarm.transitions.rows import Rows
from pneumarm.transitions.window import QUANTITIES, transitions


@dataclass(frozen=True)
class WatchSettings(Settings):
    """When an arm counts as changed."""

    allowance: Annotated[float, Meta(ge=1)] = 1.3
    """a: mean square of the standardised residue that is no change yet; a policy's movements are other ones than
    those that the simulation was judged on."""
    alarm: PositiveFloat = 10.0
    """h: with it an unchanged arm raises an alarm about once in 3,000 movements; measured by ``python -m benchmarks
    adaptation``."""
    largest: float = 4.0
    """c: the most that a single movement counts."""
    window: PositiveInt = 20
    """Movements over which the ratio that people are told is taken."""

    def _valid(self) -> Valid:
        return {"allowance": self.allowance < self.largest or "below largest"}


class ChangeDetector:
    """Cumulative sums of a simulation's errors, one for each of its outputs."""

    def __init__(self, settings: WatchSettings, outputs: int) -> None:
        self._settings = settings
        self.movements = 0
        """Movements seen."""
        self.alarmed = False
        """Whether a change was noticed since the last :meth:`reset`."""
        self.since = 0
        """Movements that had been made when the change that was noticed last began."""
        self._outputs = outputs
        self._sums = np.zeros(outputs)
        self._began = np.zeros(outputs, np.int64)
        self._recent: list[list[float]] = []

    def observe(self, squares: ArrayLike) -> bool:
        """Count a movement with the mean standardised ``squares`` (outputs,); whether a change is noticed now."""
        x = np.asarray(squares, np.float64)
        self._recent = [*self._recent, x.tolist()][-self._settings.window :]
        self._sums = np.maximum(self._sums + np.minimum(x, self._settings.largest) - self._settings.allowance, 0.0)
        self.movements += 1
        self._began[self._sums == 0] = self.movements
        over = self._sums > self._settings.alarm
        if self.alarmed or not over.any():
            return False
        self.alarmed, self.since = True, int(self._began[over].min())
        return True

    def skip(self) -> None:
        """Count a movement that tells nothing."""
        self.movements += 1
        self._began[self._sums == 0] = self.movements

    def reset(self) -> None:
        """Begin anew, with a simulation that fits the arm as it is now."""
        self.alarmed = False
        self._sums[:] = 0.0
        self._began[:] = self.movements
        self._recent = []

    @property
    def ratio(self) -> NDArray[np.float64]:
        """Error of the last movements over that of the fit, shape (outputs,); NaN before the first."""
        if not self._recent:
            return np.full(self._outputs, np.nan)
        return np.sqrt(np.mean(self._recent, axis=0))

    def get_state(self) -> dict[str, Any]:
        """Return all that its future depends on besides its settings, of JSON's types."""
        return {
            "movements": self.movements,
            "alarmed": self.alarmed,
            "since": self.since,
            "sums": self._sums.tolist(),
            "began": self._began.tolist(),
            "recent": self._recent,
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take up a state of :meth:`get_state`.

        Raises:
            UnusableInput: it is of another simulation, or damaged.

        """
        try:
            self.movements, self.alarmed = int(state["movements"]), bool(state["alarmed"])
            self.since = int(state["since"])
            self._sums = np.array(state["sums"], np.float64)
            self._began = np.array(state["began"], np.int64)
            self._recent = [[float(x) for x in one] for one in state["recent"]]
        except (KeyError, TypeError, ValueError) as error:
            raise UnusableInput(f"the state of the detector is damaged ({error}); begin another folder") from error
        if self._sums.shape != (self._outputs,) or self._began.shape != (self._outputs,):
            raise UnusableInput("the state of the detector is of another simulation; begin another folder")


def standardised_squares(simulation: Simulation, rows: Rows) -> NDArray[np.float64]:
    """Return the mean squares of the residues of ``rows`` over those of the fit, shape (outputs,).

    What tells nothing is one: of rows of which no transition can be made, and of pressures that are estimated.
    """
    found = transitions(rows, simulation.window)
    if not len(found.inputs):
        return np.ones(len(simulation.outputs))
    error = residue(simulation, found)[:, simulation.outputs]
    squares: NDArray[np.float64] = (error**2).mean(axis=0) / error_squares(simulation)
    return np.where(simulation.measured, squares, 1.0)


def error_squares(simulation: Simulation) -> NDArray[np.float64]:
    """Return the mean squared error of the fit, shape (outputs,), not 0 even for a simulation without error."""
    scale = simulation.scaling.observation_scale[simulation.outputs]
    return np.maximum(simulation.errors[simulation.outputs], 1e-6 * scale) ** 2


def output_names(simulation: Simulation) -> list[str]:
    """Return what each output is called: ``angle``, and with several joints ``angle of joint 2``."""
    window = simulation.window
    names = [
        quantity + (f" of joint {joint + 1}" if window.joints > 1 else "")
        for joint in range(window.joints)
        for quantity in QUANTITIES
    ]
    return [[*names, *window.further][place] for place in simulation.outputs]
