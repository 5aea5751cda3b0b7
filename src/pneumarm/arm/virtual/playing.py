"""How a virtual arm plays a plan of faults.

An arm without faults does nothing here. With some, waits are cut where a fault begins, ends or has to be followed
(a falling supply, a filling buffer); between the cuts the same kernels run on constants
that the faults have changed. So a fault costs what it needs, and the physics knows of none.
"""

import math
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.virtual.body import Body
from pneumarm.arm.virtual.constants import Constants, hang
from pneumarm.arm.virtual.faults import (
    Cold,
    DeadPotentiometer,
    Fault,
    FrozenPotentiometer,
    Leak,
    LogarithmicPotentiometer,
    Payload,
    Plan,
    Push,
    ReducerLeak,
    SensorNoise,
    StuckValve,
    SupplyLoss,
    SwappedMuscles,
    SwappedValves,
    ValveSideSensor,
    WornPotentiometer,
)
from pneumarm.arm.virtual.parameters import ATMOSPHERE, BAR, ArmParameters
from pneumarm.arm.virtual.state import INLET, OUTLET
from pneumarm.errors import UnusableInput

FOLLOWED = 0.05
"""A pressure of the supply that changes is followed in steps of this [s]."""
FOLLOWED_IDLE = 10.0
"""... or of this, while a buffer fills and no inlet is open [s]."""
_SIDES = {"inlet": INLET, "outlet": OUTLET}


class FaultPlayer:
    """Plays ``plan`` on the records of a virtual arm: its constants, valves and readings.

    Args:
        plan: the faults, checked.
        parameters: of the arm.
        body: its; the constants are changed in place, and put back by :meth:`restore`.
        period: the control period, which pulses are shares of [s].

    """

    def __init__(self, plan: Plan, parameters: ArmParameters, body: Body, period: float) -> None:
        count = len(parameters.joints)
        self.plan = plan
        self._parameters = parameters
        self._body, self._period = body, period
        self.sound = Constants(*(record.copy() for record in body.constants))
        """The constants as they are without faults."""
        self._state = np.zeros(1, _state_dtype(count, len(self.plan)))
        self._state["frozen"] = np.nan
        self._now: list[Fault] = []
        self.update(self.time)

    @property
    def time(self) -> float:
        """The arm's clock [s]."""
        return float(self._body.surroundings["time"][0])

    @property
    def asked(self) -> NDArray[np.float64]:
        """The command (joints, 2) that was last asked for."""
        command: NDArray[np.float64] = self._state["asked"][0]
        return command

    def digest(self) -> bytes:
        """Return what distinguishes this plan from others."""
        return msgspec.json.encode(self.plan)

    def restore(self) -> None:
        """Put the arm back to what it is without faults."""
        self._restore_constants()

    def _restore_constants(self) -> None:
        for record, sound in zip(self._body.constants, self.sound, strict=True):
            record[...] = sound

    def ask(self, command: NDArray[np.float64]) -> None:
        """Note the ``command`` (joints, 2), asked for now."""
        self._state["asked"], self._state["asked_at"] = command, self.time

    def route(self) -> NDArray[np.float64]:
        """Return until when which valves are open by what was asked for, (joints, 2, inlet and outlet) [s]."""
        told = self.asked.copy()
        for fault in self._now:
            if isinstance(fault, SwappedMuscles):
                told[fault.index], told[fault.other] = told[fault.other], told[fault.index]
        for fault in self._now:
            if isinstance(fault, SwappedValves):
                told[fault.index] = -told[fault.index]
        share = np.stack([told, -told], axis=-1)
        until = np.where(share >= 1, np.inf, float(self._state["asked_at"][0]) + share * self._period)
        for fault in self._now:
            if isinstance(fault, StuckValve):
                until[(*fault.index, _SIDES[fault.valve])] = np.inf if fault.position == "open" else -np.inf
        return until

    def next_change(self) -> float:
        """Return when :meth:`update` must be called next [s]."""
        now = self.time
        edges = [edge for fault in self.plan for edge in (fault.begin, fault.end) if edge is not None and edge > now]
        following = min(edges, default=math.inf)
        for fault in self._now:
            if isinstance(fault, SupplyLoss) and now < fault.begin + fault.over:
                following = min(following, now + FOLLOWED)
            elif isinstance(fault, ReducerLeak):
                following = min(following, now + (FOLLOWED if self._inlets() else FOLLOWED_IDLE))
        return following

    def update(self, time: float) -> bool:
        """Bring everything to ``time``, which is now [s]; return whether faults have begun or ended."""
        state = self._state[0]
        elapsed, state["time"] = time - float(state["time"]), time
        self._fill(elapsed)
        playing = [fault for fault in self.plan if fault.is_on(time)]
        changed = playing != self._now
        self._now = playing
        if changed:
            self._begin(time)
        if changed or any(isinstance(fault, SupplyLoss | ReducerLeak) for fault in playing):
            self._change(time)
        return changed

    def _inlets(self) -> int:
        """Return how many inlets are open or about to be."""
        side = self._body.muscles["pending"][..., INLET] + self._body.muscles["open"][..., INLET]
        return int((side > 0).sum())

    def _fill(self, elapsed: float) -> None:
        """Let the buffer behind a leaking reducer fill or empty for ``elapsed`` [s]."""
        for fault in self._now:
            if isinstance(fault, ReducerLeak):
                above = fault.source * BAR - (self._sound_supply - ATMOSPHERE)
                excess = float(self._state["excess"][0])
                inflow = fault.rate * BAR * max(0.0, 1 - excess / above) if above > 0 else 0.0
                drawn = fault.consumption * BAR * self._inlets()
                self._state["excess"] = min(max(excess + elapsed * (inflow - drawn), 0.0), max(above, 0.0))

    @property
    def _sound_supply(self) -> float:
        return float(self.sound.surroundings["supply"][0])

    def _begin(self, time: float) -> None:
        """Do what is done once, where a fault begins, and undo what ended."""
        state, sensors = self._state[0], self._parameters.sensors
        for number, fault in enumerate(self.plan):
            playing = fault.is_on(time)
            begins = playing and not state["begun"][number]
            state["begun"][number] = playing
            if isinstance(fault, FrozenPotentiometer) and begins:
                angle = sensors.counts_per_degree * math.degrees(float(self._body.joints["angle"][fault.place]))
                reading = math.floor(sensors.highest / 2 + angle + 0.5)
                state["frozen"][fault.place] = min(max(reading, 0.0), sensors.highest)
            if isinstance(fault, Cold) and begins:
                self._body.muscles["temperature"] = fault.temperature
                self._body.surroundings["temperature"] = fault.temperature
        if not any(isinstance(fault, ReducerLeak) for fault in self._now):
            state["excess"] = 0.0

    def _change(self, time: float) -> None:
        """Change the constants to what the faults that are on make of them."""
        self._restore_constants()
        fixed, sensors = self._body.constants, self._parameters.sensors
        for fault in self._now:
            match fault:
                case Leak():
                    fixed.muscles["leak"][fault.index] *= fault.factor
                case Payload():
                    distance = self._parameters.joints[fault.place].distance
                    hang(fixed, fault.place, distance, fault.mass, self._parameters.coupling)
                case Push():
                    fixed.joints["push"][fault.place] += fault.torque
                case SupplyLoss():
                    left = max(0.0, 1 - (time - fault.begin) / fault.over) if fault.over else 0.0
                    low = min(fault.to * BAR + ATMOSPHERE, self._sound_supply)
                    fixed.surroundings["supply"] = low + left * (self._sound_supply - low)
                    for name in ("fluctuation", "compressor"):  # what does not come in does not fluctuate
                        share = (fixed.surroundings["supply"] - ATMOSPHERE) / (self._sound_supply - ATMOSPHERE)
                        fixed.surroundings[name] *= share
                case ReducerLeak():
                    fixed.surroundings["supply"] += self._state["excess"]
                    valve = fault.source if fault.safety_valve is None else fault.safety_valve
                    fixed.surroundings["safety_valve"] = valve * BAR + ATMOSPHERE
                case ValveSideSensor():
                    fixed.muscles["sensor_share"][fault.index] = fault.share
                    fixed.muscles["sensor_settling"][fault.index] = fault.settling
                case Cold():
                    fixed.surroundings["cold"] = fixed.surroundings["warm"] = fault.temperature
                case SensorNoise():
                    fixed.sensors["angle_noise"] = fault.angle
                    fixed.sensors["pressure_noise"] = fault.pressure
                    fixed.sensors["noise_limit"] = max(
                        4 * fault.angle, 4 * fault.pressure, float(self.sound.sensors["noise_limit"][0])
                    )
                case DeadPotentiometer():
                    fixed.joints["rail"][fault.place] = 0.0 if fault.rail == "low" else sensors.highest
                case FrozenPotentiometer():
                    fixed.joints["frozen"][fault.place] = self._state["frozen"][0][fault.place]
                case LogarithmicPotentiometer():
                    fixed.joints["bend"][fault.place] = 2 * math.log(1 / fault.middle - 1)
                case WornPotentiometer():
                    place: Any = fixed.joints[fault.place : fault.place + 1]
                    place["worn_at"] = sensors.highest / 2 + sensors.counts_per_degree * fault.angle
                    place["worn_width"] = sensors.counts_per_degree * fault.width
                    place["worn_height"], place["worn_contact"] = fault.height, fault.contact

    # ---- saved states

    def get_state(self) -> bytes:
        """Return all that the future depends on besides plan and arm."""
        return self._state.tobytes()

    @property
    def state_size(self) -> int:
        """Length of a state [bytes]."""
        return self._state.nbytes

    def check_state(self, state: bytes, name: str) -> NDArray[Any]:
        """Return a ``state`` of :meth:`get_state` of the arm ``name`` as a record.

        Raises:
            UnusableInput: it is none.

        """
        found: NDArray[Any] = np.frombuffer(state, self._state.dtype)
        finite = all(np.isfinite(found[name]).all() for name in ("time", "excess", "asked_at"))
        if found.shape != (1,) or not finite or not (np.abs(found["asked"]) <= 1).all():
            raise UnusableInput(f"{name}: the saved state is damaged: that of its faults holds impossible numbers")
        return found

    def set_state(self, found: NDArray[Any]) -> None:
        """Take up what :meth:`check_state` returned, after the arm has taken up its own state."""
        self._state[...] = found
        self._now = [fault for number, fault in enumerate(self.plan) if found["begun"][0][number]]
        self._change(self.time)


def _state_dtype(joints: int, faults: int) -> np.dtype[Any]:
    return np.dtype(
        [
            ("time", "f8"),  # of the last update [s]
            ("excess", "f8"),  # pressure that a leaking reducer added to the supply [Pa]
            ("frozen", "f8", (joints,)),  # [counts]
            ("asked", "f8", (joints, 2)),  # the last command
            ("asked_at", "f8"),  # [s]
            ("begun", "i1", (faults,)),
        ]
    )
