"""The monitor: watches an arm while it moves, names what is wrong, and marks what nothing may be learned from."""

import json
import math
from base64 import b64decode, b64encode
from collections.abc import Mapping
from dataclasses import asdict, replace

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec, Reading, measured
from pneumarm.arm.valves import Command
from pneumarm.control.monitor.evidence import (
    ZONES,
    Memory,
    Thresholds,
    new_memory,
    see_by_identification,
    see_by_simulation,
)
from pneumarm.control.monitor.expectation import predictor
from pneumarm.control.monitor.findings import CHANGES, DISAGREEMENTS, Finding, Key, marks_of
from pneumarm.control.monitor.hypotheses import hypotheses
from pneumarm.control.monitor.identification import (
    ALL,
    EXPERIENCE,
    LOOKS,
    Identified,
    count_of_looks,
    forget_answers,
    identified,
    wrong_from_the_start,
)
from pneumarm.control.monitor.settings import Mode, MonitorSettings, Weighing
from pneumarm.errors import UnusableInput
from pneumarm.simulation.simulation import Simulation
from pneumarm.transitions.rows import Mark, Recorded

_QUANTITIES = ("angle", "pressure 1", "pressure 2")
_LONG = 1 / 3  # s; equal angles for less show nothing
_RARE = math.log(1e6)  # of so many equal angles of a sound arm, about one is called frozen
_OVER = 1.3  # highest pressures; a closed muscle that is compressed comes to 1.15
_FEWEST = 10  # residuals of which a mean square is taken seriously


class Monitor:
    """Watches an arm; a :class:`~pneumarm.transitions.watch.Watch`.

    Valves, supply and large leaks are judged by what the monitor itself learns of the arm while it watches
    (:mod:`pneumarm.control.monitor.identification`), from twenty seconds on and the better the longer; and it is
    noticed if pressures do what no sound arm's do. With a ``simulation`` of the arm they are judged by what that
    expects until the monitor has seen each muscle fill and empty for long enough itself; and an arm that has changed
    is noticed. Potentiometers on a rail or frozen are found in both cases.
    Of an arm without pressure sensors only the angles are judged: potentiometers, and by a simulation whether the arm
    has changed, whatever the reason.

    Args:
        spec: the arm.
        simulation: of the arm; None before there is one.
        settings: how much evidence is wanted.
        mode: ``stop`` marks what is spoiled, so that nothing is learned from it and collecting gives up on an arm
            that stays broken; ``warn`` only finds; ``off`` sees nothing.

    Raises:
        UnusableInput: the simulation is one of another arm, or of continuous commands.

    """

    def __init__(
        self,
        spec: ArmSpec,
        simulation: Simulation | None = None,
        settings: MonitorSettings | None = None,
        mode: Mode = "stop",
    ) -> None:
        self.spec, self.settings = spec, settings or MonitorSettings()
        if simulation is not None and (simulation.window.joints != spec.joints or not simulation.valves):
            raise UnusableInput(
                f"the simulation is of {simulation.window.joints} joint(s), the arm {spec.name} has {spec.joints} "
                "and on/off valves; give the one that was fitted to this arm"
            )
        self.mode = mode
        self.findings: list[Finding] = []
        """All that was found, in the order of being found."""
        self._earlier = 0  # so many findings are told on a clock of the arm that has ended
        self._open: dict[Key, int] = {}  # places in findings of what is not over
        self._hypotheses, self._readings = hypotheses(spec.joints, spec.muscles)
        if not spec.pressure_sensors:  # estimates follow the commands, whatever valves and air do
            self._hypotheses, self._readings = self._hypotheses[:1], self._readings.first(1)
        history = 2 if simulation is None else max(2, simulation.window.history)
        stops = 0 if simulation is None else simulation.window.memory_size
        self._memory = new_memory(spec.joints, history, len(self._hypotheses), stops)
        self._simulation = simulation
        self._known = identified(spec)
        self._predictor = None if simulation is None else predictor(simulation)
        self._by_simulation = self._packed(self.settings.by_simulation)
        self._by_identification = self._packed(self.settings.by_identification)
        self._judge_by_simulation(simulation is not None)
        self._from_the_start: dict[Key, float] = {}  # what no sound arm does
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
        self._simulation, self._predictor = simulation, predictor(simulation)
        self._measured[...] = measured_before
        memory = self._memory
        memory.disagreement[...] = memory.zone[...] = 0.0
        memory.score[[one.kind in CHANGES for one in self._hypotheses]] = 0.0
        for key in [key for key in self._open if key[0] in CHANGES]:
            self._close(key, float(memory.clock[0]))
        self._note_what_is_open()

    @property
    def familiar(self) -> bool:
        """Whether it has seen enough of the arm to tell what is unusual; with a simulation it has from the start."""
        return self._predictor is not None or bool(self._known.clock[2] * self._known.look[1] >= EXPERIENCE)

    def _judge_by_simulation(self, trusted: bool) -> None:
        """Judge valves and air by the simulation while it is ``trusted``, then by what is known of the arm."""
        self._trusts_simulation = trusted
        weighing = self.settings.by_simulation if trusted else self.settings.by_identification
        self._thresholds = self._by_simulation if trusted else self._by_identification
        self._prior = np.array([weighing.supply * (one.kind == "low-supply") for one in self._hypotheses])

    def _packed(self, weighing: Weighing) -> Thresholds:
        settings, spec = self.settings, self.spec
        return Thresholds(
            most=settings.most,
            kept=math.exp(-spec.period / settings.fading),
            torn=math.exp(-spec.period / settings.torn),
            alarm=weighing.alarm,
            telling=weighing.telling,
            inflation=settings.inflation,
            full=weighing.full,
            empty=weighing.empty * spec.max_pressure_counts,
            over=_OVER * spec.max_pressure_counts,
            clear=weighing.clear * spec.max_pressure_counts,
            unsure=weighing.unsure,
            calm=1e-3 * settings.calm * spec.counts_per_degree,
            fast=1e-3 * settings.fast * spec.counts_per_degree,
            apart=settings.apart,
            changed=settings.changed,
            low=spec.angle_range[0],
            high=spec.angle_range[1],
            jump=settings.jump * spec.counts_per_degree,
            acted=settings.acted * spec.max_pressure_counts,
            frozen=max(settings.frozen, math.ceil(_LONG / spec.period)),
            edge=settings.edge * (spec.angle_range[1] - spec.angle_range[0]),
            experience=EXPERIENCE / spec.period,
        )

    # ---- watching

    def begin(self, *, at_rest: bool) -> None:
        """Begin a new sequence: the window is emptied, evidence stays."""
        memory = self._memory
        memory.clock[1] = 0.0
        memory.clock[2] = 1.0 if at_rest else memory.observed.shape[0] + 1.0
        memory.command[...] = 0.0
        memory.scatter[..., 2] = 0.0
        self._begin_identifying(at_rest)
        broken = {(key[0], key[2]) for key in self._open}
        for j in range(self.spec.joints):  # what is broken stays so
            if ("frozen-potentiometer", j + 1) not in broken:
                memory.same[j] = 0.0
            if ("dead-potentiometer", j + 1) not in broken:
                memory.rail[j] = 0.0

    def _begin_identifying(self, at_rest: bool) -> None:
        """Begin a sequence with what has been learned of the arm so far, and look for what no sound arm does.

        With a simulation that is not looked for: a controller may well hold a pressure of a leaky muscle for long.
        """
        known = self._known
        known.open[...] = known.opened[...] = known.held[...] = 0.0
        known.clock[:2] = 0.0, 0.0 if at_rest else -LOOKS - known.late[0]
        if self._predictor is not None:
            return
        since = float(self._memory.clock[0])
        found = wrong_from_the_start(known)
        self._from_the_start = {key: self._from_the_start.get(key, since) for key in found}
        forget_answers(known)

    def see(self, reading: Reading, valves: Command | None) -> None:
        """Weigh a reading and remember the ``valves`` (joints, 2) as applied after it."""
        if self.mode == "off":
            return
        memory = self._memory
        if reading.time < memory.clock[0]:
            self._go_on_from(reading.time)
        if memory.clock[1] and not 0.5 < (reading.time - memory.clock[0]) / self.spec.period < 1.5:
            self.begin(at_rest=False)  # a lost period: nothing is known of what was in it
        if self._predictor is None:
            see_by_identification(
                self._known,
                self._readings,
                self._by_identification,
                memory,
                reading.time,
                reading.angle,
                reading.pressure,
            )
        else:
            see_by_simulation(
                self._predictor,
                self._known,
                self._readings,
                (self._by_simulation, self._by_identification),
                self._trusts_simulation,
                memory,
                reading.time,
                reading.angle,
                reading.pressure,
            )
            if self._trusts_simulation and not memory.clock[4] and self._has_seen_all():
                memory.score[...] = 0.0
                self._judge_by_simulation(False)
        self._note_further(reading)
        # Not by a kernel: handing the memory over to one takes longer than the kernel.
        memory.command[0] = 0.0 if valves is None else valves.ravel()
        if self._suspicious():
            self._decide(reading.time)

    @property
    def _measured(self) -> NDArray[np.float64]:
        """What further sensors said, shape (history, needs); (0, 0) where none is needed."""
        return np.zeros((0, 0)) if self._predictor is None else self._predictor.measured

    def _has_seen_all(self) -> bool:
        """Whether each muscle was seen to fill and to empty for long enough, so that the simulation is not needed."""
        looks = count_of_looks(self._known)[:: 3 - self.spec.muscles]
        return bool(self.spec.pressure_sensors and looks.min() * self._known.look[1] >= ALL)

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
            or self._from_the_start
            or memory.same[:, 0].max() >= self._thresholds.frozen
            or memory.rail[:, 0].max() >= settings.rail
            or memory.disagreement.max() >= settings.changed
        )

    def _decide(self, now: float) -> None:
        """Open findings for what has enough evidence, and close those that have none left."""
        memory = self._memory
        holding = self._judge_potentiometers()
        crosswise = any(key[0].startswith("swapped") for key in self._from_the_start)
        if holding or crosswise:  # what follows from a wrong angle, or was learned of a wrong arm, proves nothing
            memory.score[...] = 0.0
        holding |= self._judge_valves()
        if any(key[0] not in CHANGES for key in holding):  # what a fault explains says nothing of the arm
            memory.disagreement[...] = 0.0
        holding |= self._from_the_start
        holding |= self._judge_agreement(any(key[0] == "leak" for key in holding))
        for key, since in holding.items():
            if key not in self._open:
                kind, detail, joint, muscle = key
                self._open[key] = len(self.findings)
                self.findings.append(Finding(kind, detail, joint, muscle, since, now))
        for key in [key for key in self._open if key not in holding]:
            self._close(key, now)
        self._note_what_is_open()

    def _note_what_is_open(self) -> None:
        """Tell the kernels. Residuals of an arm that has changed are larger, and no proof of a stuck valve."""
        has_changed = any(key[0] in DISAGREEMENTS for key in self._open)
        is_wrong = any(key[0] not in CHANGES for key in self._open)
        self._memory.clock[3:] = self.settings.apart if has_changed else 1.0, is_wrong, bool(self._open)

    def _close(self, key: Key, now: float) -> None:
        place = self._open.pop(key)
        self.findings[place] = replace(self.findings[place], until=now)

    def _rename(self, key: Key, to: Key) -> None:
        """Call what is open another name: with few readings several faults look alike."""
        place = self._open.pop(key)
        kind, detail, joint, muscle = to
        self._open[to] = place
        self.findings[place] = replace(self.findings[place], kind=kind, detail=detail, joint=joint, muscle=muscle)

    def _judge_potentiometers(self) -> dict[Key, float]:
        memory, settings = self._memory, self.settings
        found: dict[Key, float] = {}
        for j in range(self.spec.joints):
            count, since, jumped, _ = memory.rail[j]
            if jumped and count >= settings.rail:
                found["dead-potentiometer", "its reading jumped onto a rail and stays there", j + 1, None] = since
            count, since, least, most = memory.same[j]
            if count >= self._thresholds.frozen and most - least >= self._acted(j, count):
                found["frozen-potentiometer", "its reading stays the same while valves act", j + 1, None] = since
        return found

    def _acted(self, j: int, count: float) -> float:
        """Return by how much the pressures of joint ``j`` never change apart [counts] while its angle stays the same.

        ``count`` equal readings are not asked: before them this arm may have shown the same angle during large
        changes, with a sensor of few bits, dry friction, or at an end stop. Of changes whose sizes follow an
        exponential law the largest of n is about log n times their mean, so one that is k times that is as rare as
        n to the power of -k. At the farthest angles a joint stays during changes at least as large as elsewhere.
        """
        memory, limits = self._memory, self._thresholds
        readings, _, low, high = memory.moved[j]
        angle = memory.observed[0, j, 0]
        edge = min(angle - low, high - angle) < limits.edge
        if readings < limits.experience or memory.stayed[j, int(edge), 0] - count < limits.experience / 4:
            return math.inf
        stays = [(times, most) for _, times, most in memory.stayed[j, : 2 if edge else 1] if times]
        return max([limits.acted, *(float(most) * _RARE / math.log1p(times) for times, most in stays)])

    def _judge_valves(self) -> dict[Key, float]:
        """What was found stays until nothing speaks for it, or is renamed where another fault explains more."""
        memory = self._memory
        weighed = np.where(memory.score > 0, memory.score + self._prior, 0.0)
        order = np.argsort(weighed)[::-1]
        best = int(order[0])
        keys = [(one.kind, one.detail, one.joint, one.muscle) for one in self._hypotheses]
        known = [h for h in order.tolist() if keys[h] in self._open]
        if known and weighed[best] - weighed[known[0]] >= self.settings.lead:
            before = keys[known[0]]
            self._rename(before, keys[best])
            known = [best, *(h for h in known if keys[h] != before)]
        found = {keys[h]: float(memory.since[h]) for h in known if memory.score[h] > 0}
        if found:
            return found
        if weighed[best] >= self._thresholds.alarm:
            found[keys[best]] = float(memory.since[best])
        return found

    def _judge_agreement(self, explained: bool) -> dict[Key, float]:
        """Readings that do not agree with the simulation mean nothing more where a fault explains them."""
        memory, settings = self._memory, self.settings
        found: dict[Key, float] = {}
        for j, q in np.argwhere(memory.disagreement > 0).tolist():
            place = (j + 1, q or None)
            known = next((key for key in self._open if key[0] in DISAGREEMENTS and key[2:] == place), None)
            enough = memory.disagreement[j, q] >= settings.changed and not explained
            if known is None and not enough:
                continue
            key: Key = (*self._why(j, q), *place)
            if known is not None:
                if DISAGREEMENTS.index(key[0]) > DISAGREEMENTS.index(known[0]):
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
        wrong = [one for one in self.now if one.spoils and self.mode == "stop"]
        first = min(wrong, key=lambda one: one.since, default=None)
        return None if first is None else (first.since, str(first))

    def marks(self, recorded: Recorded) -> tuple[Mark, ...]:
        """Return the marks of a sequence that it has seen."""
        if self.mode != "stop":
            return ()
        return marks_of(self.findings[self._earlier :], recorded.time, recorded.step)

    def reasons(self) -> str:
        """Return what was seen that is wrong now, and what it is judged against, in a sentence for people."""
        seen = []
        for m, (when, *counts) in enumerate(self._memory.surprise if self.spec.pressure_sensors else ()):
            concerned = any(one.muscle in (None, m % 2 + 1) and one.joint in (None, m // 2 + 1) for one in self.now)
            if when > 0 and concerned:
                read, expected, std = self.spec.bar(counts)
                seen.append(
                    f"at {when:.1f} s pressure {m % 2 + 1} of joint {m // 2 + 1} read {read:.2f} bar where "
                    f"{expected:.2f} ± {std:.2f} was expected"
                )
        if self._trusts_simulation:
            against = "what the simulation of this arm expects"
        else:
            known = float(self._known.clock[2] * self._known.look[1])
            against = f"what this arm itself did in the {known:.0f} s that it was watched"
        shown = "; ".join(seen) or "no single reading is far off, together they are"
        return f"{shown}. It is judged against {against}"

    # ---- saved states

    def get_state(self) -> bytes:
        """Return all that its future depends on besides what it was made with."""
        state = {
            "memory": {name: values.tolist() for name, values in self._memory._asdict().items()},
            "findings": [asdict(one) for one in self.findings],
            "earlier": self._earlier,
            "simulation": self._simulation is not None,
            "trusted": self._trusts_simulation,
            "identified": {
                name: b64encode(values.tobytes()).decode() for name, values in self._known._asdict().items()
            },
        }
        if self._measured.size:
            state["measured"] = self._measured.tolist()
        return json.dumps(state).encode()

    def know(self, state: bytes) -> None:
        """Take up what a monitor with this ``state`` had learned of the arm, as the one that watched it recorded.

        Raises:
            UnusableInput: it is none, or one of a monitor of another arm.

        """
        try:
            known = _identified_of(json.loads(state)["identified"], self._known)
            if (known.look != self._known.look).any():
                raise ValueError("it has another control period, or other ranges")
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise UnusableInput(f"what was known of the arm is damaged, or of another arm ({error})") from error
        for name, values in known._asdict().items():
            getattr(self._known, name)[...] = values
        self.begin(at_rest=True)

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
            memory = Memory(**{**self._memory._asdict(), **arrays})  # an earlier version remembered less
            same = [a.shape == b.shape for a, b in zip(memory, self._memory, strict=True)]
            further = np.array(saved.get("measured", []), np.float64).reshape(self._measured.shape)
            if not all(same) or saved["simulation"] is not (self._simulation is not None):
                raise ValueError("it has other sizes")
            known, trusted = _identified_of(saved["identified"], self._known), bool(saved["trusted"])
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise UnusableInput(
                f"the state of the monitor is damaged, of another arm or of an earlier version ({error})"
            ) from error
        for mine, values in zip(self._memory, memory, strict=True):
            mine[...] = values
        for name, values in known._asdict().items():
            getattr(self._known, name)[...] = values
        self._judge_by_simulation(trusted)
        self._measured[...] = further
        self.findings, self._earlier = findings, earlier
        self._open = {
            (one.kind, one.detail, one.joint, one.muscle): place
            for place, one in enumerate(findings)
            if one.until is None
        }


def _identified_of(saved: Mapping[str, str], mine: Identified) -> Identified:
    """Return what was saved of what is known of an arm; ValueError where it is not of one like ``mine``."""
    arrays = {name: np.frombuffer(b64decode(text)) for name, text in saved.items()}
    for name in ("open", "opened"):  # an earlier version remembered less of the last commands
        if name in arrays and "late" not in arrays:
            del arrays[name]
    shaped = {name: values.reshape(getattr(mine, name).shape) for name, values in arrays.items()}
    return Identified(**{**mine._asdict(), **shaped})
