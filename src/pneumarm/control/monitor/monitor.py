"""The monitor: watches an arm while it moves, names what is wrong, and marks what nothing may be learned from."""

import json
import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec, Reading, measured
from pneumarm.arm.valves import Command
from pneumarm.control.monitor.evidence import (
    ZONES,
    Memory,
    Thresholds,
    new_memory,
    see_by_rules,
    see_by_simulation,
)
from pneumarm.control.monitor.expectation import RuleParameters, RuleSettings, predictor, rule_parameters
from pneumarm.control.monitor.hypotheses import hypotheses
from pneumarm.errors import UnusableInput
from pneumarm.settings import Settings, Valid
from pneumarm.simulation.simulation import Simulation
from pneumarm.transitions.rows import Mark, Recorded

_QUANTITIES = ("angle", "pressure 1", "pressure 2")
_DISAGREEMENTS = ("changed", "sensor-noise", "worn-potentiometer")
"""Kinds of findings with which readings no longer agree with the simulation, so that it proves less of valves; from
the least to the most special."""
_CHANGES = (*_DISAGREEMENTS, "leak")
"""Kinds of findings with which valves do as they are told: what is read is what arm and sensors are like now."""


@dataclass(frozen=True)
class MonitorSettings(Settings):
    """How much evidence a monitor wants."""

    alarm: float = 11.0
    """Log-likelihood ratio from which on a fault of the valves or the air counts as found by a simulation."""
    alarm_by_rules: float = 9.0
    """... by the rules, which take more for possible and so give less evidence for the same."""
    supply: float = 4.0
    """Evidence that a low supply needs less: every inlet speaks for or against it, so by chance it has little.
    Of a simulation only: what the rules do not know looks like a low supply."""
    lead: float = 4.0
    """By how much that of another fault must exceed it for what was found to be called by the name of the other."""
    most: float = 5.0
    """Evidence that a single reading gives at most."""
    telling: float = 1.5
    """Pressures expected with and without a fault that differ by fewer standard deviations tell nothing."""
    inflation: float = 1.5
    """Standard deviations of the simulation's error on held-out sequences that count as one."""
    full: float = 0.75
    """Part of the highest pressure over which an open inlet tells nothing: the supply is not much higher."""
    empty: float = 0.04
    """A muscle below this is empty, and how much air it takes until its pressure rises is uncertain [bar] ..."""
    clear: float = 0.04
    """... so that expected pressures which differ by less tell nothing [bar]."""
    unsure: float = 0.2
    """Standard deviation of a filling or emptying as a part of it."""
    unsure_by_rules: float = 0.5
    """... as the rules know it."""
    calm: float = 20.0
    """A joint slower than this hardly moves [degrees/s]; large leaks are looked for then."""
    fast: float = 150.0
    """Speed at which the simulation's errors are larger by the root of two than at rest [degrees/s]."""
    apart: float = 2.5
    """An arm has changed whose errors are so many times as large as usual."""
    changed: float = 40.0
    """Log-likelihood ratio from which on the arm counts as changed."""
    alternating: float = 0.3
    """Correlation of residuals with those before them under minus which they are noise of a sensor."""
    worn: float = 6.0
    """Mean square of the residuals from which on a part of a potentiometer's range counts as worn ..."""
    sound: float = 1.0
    """... while a quarter of all parts are below this; both in squares of the residuals that are usual."""
    rail: int = 3
    """Readings on a rail, after a jump there, that show a broken potentiometer."""
    jump: float = 10.0
    """Least angle that counts as a jump onto a rail [degrees]; more where the arm was moving there."""
    frozen: int = 10
    """Equal angles in a row, while the pressures change, that show a potentiometer which is frozen."""
    acted: float = 0.10
    """Change of a pressure that shows that valves act [bar]."""
    rules: RuleSettings = field(default_factory=RuleSettings)
    """What is taken for granted before there is a simulation."""

    def _valid(self) -> Valid:
        return {
            "alarm": 0 < self.alarm < math.inf,
            "alarm_by_rules": 0 < self.alarm_by_rules < math.inf,
            "supply": 0 <= self.supply < self.alarm,
            "lead": 0 <= self.lead < math.inf,
            "most": 0 < self.most < math.inf,
            "telling": 0 <= self.telling < math.inf,
            "inflation": 0 < self.inflation < math.inf,
            "full": 0 < self.full < math.inf,
            "empty": 0 <= self.empty < math.inf,
            "clear": 0 <= self.clear < math.inf,
            "unsure": 0 <= self.unsure < math.inf,
            "unsure_by_rules": 0 <= self.unsure_by_rules < math.inf,
            "calm": 0 < self.calm < math.inf,
            "fast": 0 < self.fast < math.inf,
            "apart": 1 < self.apart < math.inf,
            "changed": 0 < self.changed < math.inf,
            "alternating": 0 < self.alternating < 1,
            "worn": self.sound < self.worn < math.inf,
            "sound": 0 < self.sound < math.inf,
            "rail": self.rail >= 1,
            "jump": 0 < self.jump < math.inf,
            "frozen": self.frozen >= 2,
            "acted": 0 < self.acted < math.inf,
        }


@dataclass(frozen=True)
class Finding:
    """Something that is wrong with an arm."""

    kind: str
    """As the faults of a virtual arm are called; ``low-supply``; ``changed`` where readings no longer agree with the
    simulation, and neither noise of a sensor nor a worn potentiometer is the reason."""
    detail: str
    """What it is in words."""
    joint: int | None
    """Joint from 1; None where it is about the whole arm."""
    muscle: int | None
    """Muscle 1 or 2; None where it is about the joint or the whole arm."""
    since: float
    """When it began, as far as can be told [s]."""
    noticed: float
    """When it was found [s]."""
    until: float | None = None
    """When it was over [s]; None while it is not."""

    @property
    def spoils(self) -> bool:
        """Whether nothing may be learned from what was read meanwhile.

        An arm that has changed, or leaks, is still an arm: what it does then is what there is to learn.
        """
        return self.kind not in _CHANGES

    def __str__(self) -> str:
        place = "" if self.joint is None else f"joint {self.joint}"
        place += "" if self.muscle is None else f", muscle {self.muscle}"
        ended = "" if self.until is None else f" until {self.until:.1f} s"
        return f"{self.kind}{': ' + place if place else ''} ({self.detail}) since {self.since:.1f} s{ended}"

    def overlaps(self, begin: float, end: float) -> bool:
        """Whether it was there at some time from ``begin`` to ``end`` [s]."""
        return self.since <= end and (self.until is None or self.until >= begin)


_FEWEST = 10  # residuals of which a mean square is taken seriously
_Key = tuple[str, str, int | None, int | None]


class Monitor:
    """Watches an arm; a :class:`~pneumarm.transitions.Watch`.

    With a ``simulation`` of the arm valves, supply and large leaks are judged by what it expects, and an arm that
    has changed is noticed. Without one, rules of thumb do the first three with less certainty (valves and supply
    take longer, large leaks may not be found). Potentiometers on a rail or frozen are found by rules in both cases.

    Args:
        spec: the arm.
        simulation: of the arm; None before there is one.
        settings: how much evidence is wanted.

    Raises:
        UnusableInput: the simulation is one of another arm, or of continuous commands.

    """

    def __init__(
        self, spec: ArmSpec, simulation: Simulation | None = None, settings: MonitorSettings | None = None
    ) -> None:
        self.spec, self.settings = spec, settings or MonitorSettings()
        if simulation is not None and (simulation.window.joints != spec.joints or not simulation.valves):
            raise UnusableInput(
                f"the simulation is of {simulation.window.joints} joint(s), the arm {spec.name} has {spec.joints} "
                "and on/off valves; give the one that was fitted to this arm"
            )
        self.findings: list[Finding] = []
        """All that was found, in the order of being found."""
        self._earlier = 0  # so many findings are told on a clock of the arm that has ended
        self._open: dict[_Key, int] = {}  # places in findings of what is not over
        self._hypotheses, self._readings = hypotheses(spec.joints)
        self._prior = np.array(
            [self.settings.supply if one.kind == "low-supply" else 0.0 for one in self._hypotheses]
        )
        history = 2 if simulation is None else max(2, simulation.window.history)
        self._memory = new_memory(spec.joints, history, len(self._hypotheses))
        self._simulation = simulation
        self._thresholds = self._packed()
        self._expects = rule_parameters(self.settings.rules, spec) if simulation is None else predictor(simulation)
        self._see = see_by_rules if simulation is None else see_by_simulation
        self.begin(at_rest=True)

    def judge_by(self, simulation: Simulation) -> None:
        """Expect from now on what ``simulation`` says, which was adapted from the one before.

        What an adapted simulation says is how the arm is: the evidence that it has changed or leaks was against the
        one before, and is dropped; such findings are over. Evidence of other faults stays.

        Raises:
            UnusableInput: the monitor had no simulation, or one with another window.

        """
        if simulation is self._simulation:
            return
        if self._simulation is None or simulation.window != self._simulation.window:
            raise UnusableInput("a monitor can go on only with a simulation that was adapted from the one it has")
        measured_before = self._measured
        self._simulation, self._expects = simulation, predictor(simulation)
        self._measured[...] = measured_before
        memory = self._memory
        memory.disagreement[...] = memory.zone[...] = 0.0
        memory.score[[one.kind in _CHANGES for one in self._hypotheses]] = 0.0
        for key in [key for key in self._open if key[0] in _CHANGES]:
            self._close(key, float(memory.clock[0]))
        memory.clock[3] = self._width()

    def _packed(self) -> Thresholds:
        settings, spec = self.settings, self.spec
        return Thresholds(
            most=settings.most,
            alarm=settings.alarm if self._simulation is not None else settings.alarm_by_rules,
            telling=settings.telling,
            inflation=settings.inflation,
            full=settings.full * spec.max_pressure_counts,
            empty=settings.empty * spec.counts_per_bar,
            clear=settings.clear * spec.counts_per_bar,
            unsure=settings.unsure if self._simulation is not None else settings.unsure_by_rules,
            calm=1e-3 * settings.calm * spec.counts_per_degree,
            fast=1e-3 * settings.fast * spec.counts_per_degree,
            apart=settings.apart,
            changed=settings.changed,
            low=spec.angle_range[0],
            high=spec.angle_range[1],
            jump=settings.jump * spec.counts_per_degree,
            acted=settings.acted * spec.counts_per_bar,
        )

    # ---- watching

    def begin(self, *, at_rest: bool) -> None:
        """Begin a new sequence: the window is emptied, evidence stays."""
        memory = self._memory
        memory.clock[1] = 0.0
        memory.clock[2] = 1.0 if at_rest else memory.observed.shape[0] + 1.0
        memory.command[...] = 0.0
        memory.scatter[..., 2] = 0.0
        broken = {(key[0], key[2]) for key in self._open}
        for j in range(self.spec.joints):  # what is broken stays so
            if ("frozen-potentiometer", j + 1) not in broken:
                memory.same[j] = 0.0
            if ("dead-potentiometer", j + 1) not in broken:
                memory.rail[j] = 0.0

    def see(self, reading: Reading, valves: Command | None) -> None:
        """Weigh a reading and remember the ``valves`` (joints, 2) as applied after it."""
        memory = self._memory
        if reading.time < memory.clock[0]:
            self._go_on_from(reading.time)
        if memory.clock[1] and not 0.5 < (reading.time - memory.clock[0]) / self.spec.period < 1.5:
            self.begin(at_rest=False)  # a lost period: nothing is known of what was in it
        self._see(
            self._expects, self._readings, self._thresholds, memory, reading.time, reading.angle, reading.pressure
        )
        self._note_further(reading)
        # Not by a kernel: handing the memory over to one takes longer than the kernel.
        memory.command[0] = 0.0 if valves is None else valves.ravel()
        if self._suspicious():
            self._decide(reading.time)

    @property
    def _measured(self) -> NDArray[np.float64]:
        """What further sensors said, shape (history, needs); (0, 0) where none is needed."""
        return np.zeros((0, 0)) if isinstance(self._expects, RuleParameters) else self._expects.measured

    def _note_further(self, reading: Reading) -> None:
        """Remember what the further sensors say that the simulation needs."""
        kept = self._measured
        if kept.size and self._simulation is not None:
            values = measured(reading, self._simulation.window.needs, self.spec.name)
            kept[1:] = values if self._memory.clock[1] <= 1 else kept[:-1].copy()
            kept[0] = values

    def _go_on_from(self, now: float) -> None:
        """Go on where the arm's clock began anew and shows ``now`` [s], as after a reset of its controller.

        What is wrong stays so: such findings end with the old clock and begin anew on this one. Evidence stays too,
        as if no time had passed in between.
        """
        memory, before = self._memory, float(self._memory.clock[0])
        memory.since[...] += now - before
        memory.disagreement_since[...] += now - before
        memory.clock[0] = now
        self._earlier = len(self.findings)
        for key, place in list(self._open.items()):
            lasting = self.findings[place]
            self._close(key, before)
            self._open[key] = len(self.findings)
            self.findings.append(replace(lasting, since=now, noticed=now))

    def _suspicious(self) -> bool:
        """Whether there is something to decide; most of the time there is not."""
        memory, settings = self._memory, self.settings
        return bool(
            self._open
            or (memory.score + self._prior).max() >= self._thresholds.alarm
            or memory.same[:, 0].max() >= settings.frozen
            or memory.rail[:, 0].max() >= settings.rail
            or memory.disagreement.max() >= settings.changed
        )

    def _decide(self, now: float) -> None:
        """Open findings for what has enough evidence, and close those that have none left."""
        memory = self._memory
        holding = self._judge_potentiometers()
        if holding:  # what follows from a wrong angle proves nothing
            memory.score[...] = 0.0
        holding |= self._judge_valves()
        if any(key[0] not in _CHANGES for key in holding):  # what a fault explains says nothing of the arm
            memory.disagreement[...] = 0.0
        holding |= self._judge_agreement(any(key[0] == "leak" for key in holding))
        for key, since in holding.items():
            if key not in self._open:
                kind, detail, joint, muscle = key
                self._open[key] = len(self.findings)
                self.findings.append(Finding(kind, detail, joint, muscle, since, now))
        for key in [key for key in self._open if key not in holding]:
            self._close(key, now)
        self._memory.clock[3] = self._width()

    def _width(self) -> float:
        """Return how large residuals are, in usual ones: a simulation of another arm is no proof of a stuck valve."""
        return self.settings.apart if any(key[0] in _DISAGREEMENTS for key in self._open) else 1.0

    def _close(self, key: _Key, now: float) -> None:
        place = self._open.pop(key)
        self.findings[place] = replace(self.findings[place], until=now)

    def _rename(self, key: _Key, to: _Key) -> None:
        """Call what is open another name: with few readings several faults look alike."""
        place = self._open.pop(key)
        kind, detail, joint, muscle = to
        self._open[to] = place
        self.findings[place] = replace(self.findings[place], kind=kind, detail=detail, joint=joint, muscle=muscle)

    def _judge_potentiometers(self) -> dict[_Key, float]:
        memory, settings = self._memory, self.settings
        found: dict[_Key, float] = {}
        for j in range(self.spec.joints):
            count, since, jumped, _ = memory.rail[j]
            if jumped and count >= settings.rail:
                found["dead-potentiometer", "its reading jumped onto a rail and stays there", j + 1, None] = since
            count, since, *pressures = memory.same[j]
            change = max(pressures[2] - pressures[0], pressures[3] - pressures[1])
            if count >= settings.frozen and change >= self._thresholds.acted:
                found["frozen-potentiometer", "its reading stays the same while valves act", j + 1, None] = since
        return found

    def _judge_valves(self) -> dict[_Key, float]:
        """What was found stays until nothing speaks for it, or is renamed where another fault explains more."""
        memory = self._memory
        weighed = np.where(memory.score > 0, memory.score + self._prior, 0.0)
        order = np.argsort(weighed)[::-1]
        best = int(order[0])
        keys = [(one.kind, one.detail, one.joint, one.muscle) for one in self._hypotheses]
        known = [h for h in order.tolist() if keys[h] in self._open]
        if known and weighed[best] - weighed[known[0]] >= self.settings.lead:
            self._rename(keys[known[0]], keys[best])
            known = [best, *known[1:]]
        found = {keys[h]: float(memory.since[h]) for h in known if memory.score[h] > 0}
        if found:
            return found
        if weighed[best] >= self._thresholds.alarm:
            found[keys[best]] = float(memory.since[best])
        return found

    def _judge_agreement(self, explained: bool) -> dict[_Key, float]:
        """Readings that do not agree with the simulation mean nothing more where a fault explains them."""
        memory, settings = self._memory, self.settings
        found: dict[_Key, float] = {}
        for j, q in np.argwhere(memory.disagreement > 0).tolist():
            place = (j + 1, q or None)
            known = next((key for key in self._open if key[0] in _DISAGREEMENTS and key[2:] == place), None)
            enough = memory.disagreement[j, q] >= settings.changed and not explained
            if known is None and not enough:
                continue
            key: _Key = (*self._why(j, q), *place)
            if known is not None:
                if _DISAGREEMENTS.index(key[0]) > _DISAGREEMENTS.index(known[0]):
                    self._rename(known, key)
                else:
                    key = known
            found[key] = float(memory.disagreement_since[j, q])
        for key in self._open:  # elsewhere in its range a worn potentiometer reads as it should
            if key[0] == "worn-potentiometer" and key[2] is not None and self._worn_at(key[2] - 1) is not None:
                found.setdefault(key, self.findings[self._open[key]].since)
        return found

    def _why(self, j: int, q: int) -> tuple[str, str]:
        """Return what it is a sign of that quantity ``q`` of joint ``j`` does not agree with the simulation."""
        squares, products, _ = self._memory.scatter[j, q]
        if products >= -self.settings.alternating * squares:
            return "changed", f"{_QUANTITIES[q]} does not agree with the simulation"
        if q == 0 and (worn := self._worn_at(j)) is not None:
            return "worn-potentiometer", f"its reading is wrong around {worn:.0f} degrees"
        return "sensor-noise", f"the reading of {_QUANTITIES[q]} is noisy"

    def _worn_at(self, j: int) -> float | None:
        """Return the angle [degrees] around which the potentiometer of joint ``j`` is worn; None where it is not."""
        visits, squares = self._memory.zone[j].T
        seen = visits >= _FEWEST
        bad = seen & (squares > self.settings.worn)
        if not bad.any() or np.quantile(squares[seen], 0.25) > self.settings.sound:
            return None
        low, high = self.spec.angle_range
        middle = low + (np.arange(ZONES) + 0.5) / ZONES * (high - low)
        return float(self.spec.degrees(np.average(middle, weights=bad * squares)))

    # ---- what is known

    @property
    def now(self) -> list[Finding]:
        """What is wrong now."""
        return [self.findings[place] for place in self._open.values()]

    def spoiled_since(self) -> tuple[float, str] | None:
        """Return since when [s] something is wrong now that spoils what is read, and what; None if nothing is."""
        wrong = [one for one in self.now if one.spoils]
        first = min(wrong, key=lambda one: one.since, default=None)
        return None if first is None else (first.since, str(first))

    def marks(self, recorded: Recorded) -> tuple[Mark, ...]:
        """Return the marks of a sequence that it has seen."""
        return marks_of(self.findings[self._earlier :], recorded.time, recorded.step)

    # ---- saved states

    def get_state(self) -> bytes:
        """Return all that its future depends on besides what it was made with."""
        state = {
            "memory": {name: values.tolist() for name, values in self._memory._asdict().items()},
            "findings": [asdict(one) for one in self.findings],
            "earlier": self._earlier,
            "simulation": self._simulation is not None,
        }
        if self._measured.size:
            state["measured"] = self._measured.tolist()
        return json.dumps(state).encode()

    def set_state(self, state: bytes) -> None:
        """Take up a state of :meth:`get_state`, bit for bit.

        Raises:
            UnusableInput: it is none, or one of a monitor of another arm.

        """
        try:
            saved = json.loads(state)
            arrays = {name: np.array(values, np.float64) for name, values in saved["memory"].items()}
            findings = [Finding(**one) for one in saved["findings"]]
            earlier = int(saved.get("earlier", 0))
            memory = Memory(**arrays)
            same = [a.shape == b.shape for a, b in zip(memory, self._memory, strict=True)]
            further = np.array(saved.get("measured", []), np.float64).reshape(self._measured.shape)
            if not all(same) or saved["simulation"] is not (self._simulation is not None):
                raise ValueError("it has other sizes")
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise UnusableInput(f"the state of the monitor is damaged or of another arm ({error})") from error
        for mine, values in zip(self._memory, memory, strict=True):
            mine[...] = values
        self._measured[...] = further
        self.findings, self._earlier = findings, earlier
        self._open = {
            (one.kind, one.detail, one.joint, one.muscle): place
            for place, one in enumerate(findings)
            if one.until is None
        }


def marks_of(findings: Iterable[Finding], time: NDArray[np.float64], step: NDArray[np.int64]) -> tuple[Mark, ...]:
    """Return the marks that ``findings`` make on a sequence with readings at ``time`` (n,) [s] and ``step`` (n,)."""
    marks = []
    for one in findings:
        if one.spoils and one.overlaps(float(time[0]), float(time[-1])):
            inside = np.flatnonzero((time >= one.since) & (time <= (math.inf if one.until is None else one.until)))
            if len(inside):
                marks.append(Mark(int(step[inside[0]]), int(step[inside[-1]]), str(replace(one, until=None))))
    return tuple(marks)
