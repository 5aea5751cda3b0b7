"""A board in pure Python, with any arm on it: the same bytes and the same rules as the firmware's."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import Arm, Reading, checked, measured
from pneumarm.arm.serial.line import Line
from pneumarm.arm.serial.protocol import (
    ANSWER,
    DEAD_MAN_MS,
    EXTRAS,
    HIGHEST_COUNT,
    HOLD,
    JOINTS,
    LATCHES,
    LONGEST_PULSE,
    MOST_VELOCITY_MS,
    MUSCLES,
    NEWEST_AHEAD,
    OLDEST_VERSION,
    OVER_PRESSURE,
    OVER_PRESSURE_SAMPLES,
    PULSE_UNIT_US,
    PULSES_SINCE,
    REQUESTS,
    SEQUENCES,
    VELOCITY_SCALE,
    VERSION,
    WATCHDOG_MS,
    Cause,
    Code,
    Flag,
    Frame,
    Reason,
    Reply,
    Request,
    Sensors,
    Splitter,
    encode,
    pack_valves,
    unpack_valves,
)
from pneumarm.errors import UnusableInput

SAMPLE = 1e-3
"""Time between two looks at a pressure that is near its limit [s]; the firmware looks five times as often."""
SELDOM = 10e-3
"""The same while all pressures are far below their limits [s]."""
NEAR = 0.75
"""A pressure over this share of its limit is near it: no inlet fills the rest of it within SELDOM."""
FIRMWARE = 0x50594D55
"""What this board gives as the hash of its firmware."""
_SEEN = Flag.STALE_SEEN | Flag.CORRUPT_SEEN | Flag.OVERRUN_SEEN


class EmulatedBoard:
    """A board whose time is that of the arm on it: it passes only in :meth:`run_until`.

    Args:
        arm: what is moved; valves, sensors and time are its own.
        version: of the protocol; that of an older board has no pulses.

    Raises:
        UnusableInput: the arm has more joints than the board.

    """

    def __init__(self, arm: Arm, version: int = VERSION) -> None:
        if arm.spec.joints > JOINTS:
            raise UnusableInput(f"a board has pins for {JOINTS} joints, {arm.spec.name} has {arm.spec.joints}")
        self.arm = arm
        self.version = version
        self.boots = 0
        self._hung = False
        self.reset(Cause.POWER_ON)

    @property
    def time(self) -> float:
        """The arm's time [s]."""
        return self._time

    @property
    def armed(self) -> bool:
        """Whether the valves follow EXCHANGE."""
        return bool(self._flags & Flag.ARMED)

    def reset(self, cause: Cause = Cause.EXTERNAL) -> None:
        """Restart, vented."""
        self._time = self._booted = self.arm.read().time
        self._cause = cause
        self._hung = False
        self.boots = (self.boots + 1) % SEQUENCES
        self._splitter = Splitter()
        self._corrupt = 0
        self._flags = Flag(0)
        self._session: int | None = None
        self._last: Frame | None = None
        self._last_reason: Reason | None = None
        self._limits = [HIGHEST_COUNT] * MUSCLES
        self._over = [0] * MUSCLES
        self._sampled = self._time
        self._velocity_s = SAMPLE
        self._fed = self._time
        self._take_up(np.full((self.arm.spec.joints, 2), -1, np.int8))
        self._earlier = self._now = self._look()

    def hang(self) -> None:
        """Stop answering, as a program does that hangs; the watchdog restarts it."""
        self._hung = True
        self._hung_at = self._time

    def run_until(self, time: float, *, late: bool = False) -> None:
        """Let time pass until ``time`` [s], with the dead-man and the limits watched.

        ``late`` lets it be a little more, where the arm has that of a host that sleeps until then.
        """
        while self._time < time:
            near = bool((self._now.pressure.ravel() > NEAR * np.array(self._limits[: self._now.pressure.size])).any())
            step = min(self._time + (SAMPLE if near else SELDOM), time)
            velocity_from = time - self._velocity_s
            if self._time < velocity_from < step:
                step = velocity_from  # the velocity is that of the last few milliseconds
            if self.armed:
                step = min(step, max(min([self._fed + DEAD_MAN_MS / 1e3, *self._ends.values()]), self._time))
            if self._hung:
                step = min(step, max(self._hung_at + WATCHDOG_MS / 1e3, self._time))
            if late and step == time:
                self.arm.wait_until(step)
            else:
                self.arm.wait(step - self._time)
            self._look_again(velocity_from)
            self._end_pulses()
            if self._hung and self._time >= self._hung_at + WATCHDOG_MS / 1e3 - 1e-9:
                self.reset(Cause.WATCHDOG)
            if self.armed and self._time >= self._fed + DEAD_MAN_MS / 1e3 - 1e-9:
                self._vent(Flag.DEAD_MAN)

    def receive(self, data: bytes) -> bytes:
        """Return the answers to what is in ``data``, however it was cut."""
        if self._hung:
            return b""
        return b"".join(self._answered(frame) for frame in self._splitter.feed(data))

    def _look(self) -> Reading:
        reading = checked(self.arm.read(), self.arm.spec)
        self._time = reading.time
        return reading

    def _look_again(self, velocity_from: float) -> None:
        before = self._now
        self._now = self._look()
        if before.time <= velocity_from + 1e-9 or self._earlier.time < velocity_from - MOST_VELOCITY_MS / 1e3:
            self._earlier = before
        if self._now.time < self._sampled + SAMPLE - 1e-9:
            return  # looks at other times are no samples of their own
        self._sampled = self._now.time
        limits = self._limits
        for muscle, pressure in enumerate(self._now.pressure.ravel().tolist()):
            self._over[muscle] = self._over[muscle] + 1 if pressure > limits[muscle] else 0
            if self._over[muscle] >= OVER_PRESSURE_SAMPLES and self._flags & Flag.CONFIGURED:
                self._flags |= OVER_PRESSURE[muscle]
                self._apply()

    def _vent(self, latch: Flag = Flag(0)) -> None:
        self._flags = (self._flags | latch) & ~Flag.ARMED
        self._ends.clear()
        self._apply()

    def _take_up(self, valves: NDArray[np.int8], number: int | None = None, lengths: tuple[int, ...] = ()) -> None:
        """Set ``valves`` (joints, 2); for their ``lengths`` [PULSE_UNIT_US], where they are the PULSE ``number``."""
        self._asked, self._number = valves, number
        self._ends: dict[int, float] = {  # when pulses end, by muscle [s]
            muscle: self._time + 1e-6 * PULSE_UNIT_US * length
            for muscle, (valve, length) in enumerate(zip(valves.ravel().tolist(), lengths, strict=False))
            if valve and length != HOLD
        }
        self._apply()

    def _end_pulses(self) -> None:
        """Close the valves whose time is over."""
        ended = [muscle for muscle, end in self._ends.items() if end <= self._time + 1e-9]
        for muscle in ended:
            del self._ends[muscle]
            self._asked.flat[muscle] = 0
        if ended:
            self._apply()

    def _applied(self) -> NDArray[np.int8]:
        """Return the valves (joints, 2) as they are now."""
        if not self.armed:
            return np.full_like(self._asked, -1)
        latched = [bool(self._flags & OVER_PRESSURE[muscle]) for muscle in range(self._asked.size)]
        return np.where(np.reshape(latched, self._asked.shape), -1, self._asked).astype(np.int8)

    def _apply(self) -> None:
        self.arm.set_valves(self._applied())

    def _answered(self, frame: Frame) -> bytes:
        """Return the answer to ``frame``; nothing to one that is stale."""
        if frame.kind not in REQUESTS or (frame.kind == Request.PULSE and self.version < PULSES_SINCE):
            self._splitter.corrupt += 1
            return b""
        if frame.kind == Request.CONNECT:
            return self._connected(frame)
        ahead = 1 if self._last is None else (frame.sequence - self._last.sequence) % SEQUENCES
        if self._last is not None and ahead == 0 and frame.kind == self._last.kind:
            return self._reply(frame, self._last_reason, Flag.REPEATED)
        if not 1 <= ahead <= NEWEST_AHEAD:
            self._flags |= Flag.STALE_SEEN
            return b""
        if self._session is None:
            return self._reply(frame, Reason.NOT_CONNECTED)
        self._last, self._last_reason = frame, self._act(frame)
        return self._reply(frame, self._last_reason)

    def _connected(self, frame: Frame) -> bytes:
        version, session = frame.values
        if not OLDEST_VERSION <= version <= self.version:
            return self._reply(frame, Reason.WRONG_VERSION)
        self._vent()
        self._flags &= ~Flag.CONFIGURED
        self._session, self._last, self._last_reason = session, frame, None
        return encode(Reply.HELLO, frame.sequence, version, FIRMWARE, session, self._cause, self.boots)

    def _act(self, frame: Frame) -> Reason | None:
        """Do what a fresh request asks; return why not, if so."""
        values = frame.values
        if frame.kind == Request.CONFIGURE:
            return self._configure(values)
        if frame.kind == Request.ARM:
            return self._arm(values[0])
        if frame.kind == Request.DISARM:
            self._vent()
        if frame.kind == Request.EXCHANGE:
            return self._set(values[0])
        if frame.kind == Request.PULSE:
            return self._set(values[1], values[0], values[2 : 2 + MUSCLES])
        return None

    def _set(self, packed: int, number: int | None = None, lengths: tuple[int, ...] = ()) -> Reason | None:
        """Set the valves in a byte of codes, or go on with the PULSE that they are; return why not, if so."""
        if not self.armed:
            return Reason.NOT_ARMED
        if number is None or number != self._number:
            valves = unpack_valves(packed, self.arm.spec.joints)
            opened = [length for m, length in enumerate(lengths) if packed >> 2 * m & 3 != Code.CLOSED]
            if valves is None or not all(1 <= length <= LONGEST_PULSE or length == HOLD for length in opened):
                return Reason.BAD_VALUE
            self._take_up(valves, number, lengths)
        self._fed = self._time
        return None

    def _configure(self, values: tuple[int, ...]) -> Reason | None:
        conversions, velocity_ms, *limits = values
        if self.armed:
            return Reason.STILL_ARMED
        inside = all(1 <= limit <= HIGHEST_COUNT for limit in limits) and 1 <= velocity_ms <= MOST_VELOCITY_MS
        if not inside or conversions not in (5, 7, 9):
            return Reason.BAD_VALUE
        self._limits, self._velocity_s = limits, velocity_ms * 1e-3
        self._earlier = self._now
        self._flags |= Flag.CONFIGURED
        return None

    def _arm(self, session: int) -> Reason | None:
        if session != self._session:
            return Reason.WRONG_SESSION
        if not self._flags & Flag.CONFIGURED:
            return Reason.NOT_CONFIGURED
        self._now = self._look()
        pressures = self._now.pressure.ravel().tolist()
        if any(p > limit for p, limit in zip(pressures, self._limits, strict=False)):
            return Reason.CAUSE_REMAINS
        self._flags = (self._flags & ~LATCHES) | Flag.ARMED
        self._over = [0] * MUSCLES
        self._fed = self._time
        self._take_up(np.zeros_like(self._asked))
        return None

    def _reply(self, frame: Frame, reason: Reason | None, extra: Flag = Flag(0)) -> bytes:
        if self._splitter.corrupt > self._corrupt:
            self._corrupt = self._splitter.corrupt
            self._flags |= Flag.CORRUPT_SEEN
        flags = self._flags | extra
        self._flags &= ~_SEEN
        valves = pack_valves(self._applied())
        for muscle in range(self._asked.size, MUSCLES):
            valves |= pack_valves(np.array([0 if self.armed else -1], np.int8)) << 2 * muscle
        if reason is not None:
            return encode(Reply.REFUSED, frame.sequence, reason, flags, valves)
        now = self._look()
        time = round(1e6 * (now.time - self._booted)) % (1 << 32)
        if ANSWER[Request(frame.kind)] == Reply.STATUS:
            return encode(Reply.STATUS, frame.sequence, time, flags, valves)
        return encode(Reply.READING, frame.sequence, *self._sensors(now, time, flags, valves).packed())

    def _sensors(self, now: Reading, time: int, flags: Flag, valves: int) -> Sensors:
        missing = JOINTS - len(now.angle)
        angle = [_count(value) for value in now.angle.tolist()] + [0] * missing
        pressure = [_count(value) for value in now.pressure.ravel().tolist()]
        pressure += [0] * (2 * JOINTS - len(pressure))
        since = 1e3 * (now.time - self._earlier.time)
        velocity = [0] * JOINTS
        if since > 0:
            for joint, change in enumerate((now.angle - self._earlier.angle).tolist()):
                velocity[joint] = min(max(round(VELOCITY_SCALE * change / since), -32767), 32767)
        extra, sensors = [0] * EXTRAS, self.arm.spec.sensors
        if sensors:
            for one, value in zip(sensors, measured(now, (one.name for one in sensors)), strict=True):
                if one.channel is not None and one.channel <= EXTRAS:
                    extra[one.channel - 1] = _count(one.counts(value))
        return Sensors(time, flags, valves, tuple(angle), tuple(pressure), tuple(velocity), tuple(extra))


def _count(value: float) -> int:
    return min(max(round(value), 0), HIGHEST_COUNT)


class BoardLine(Line):
    """A line to a board in the same process, whose time is the arm's: as fast as the arm can be computed.

    Args:
        board: at the other end.
        delay: time that bytes take each way [s]; half a round trip of the real board is 0.5e-3.

    """

    def __init__(self, board: EmulatedBoard, delay: float = 0.0) -> None:
        self.board = board
        self.delay = delay
        self._out: deque[tuple[float, bytes]] = deque()
        self._in: deque[tuple[float, bytes]] = deque()

    def write(self, data: bytes) -> None:
        """Send ``data``; without a delay the board takes it in no time."""
        self._out.append((self.now() + self.delay, data))
        self._deliver()

    def read(self, timeout: float) -> bytes:
        """Return the board's answers; time passes only where there are none."""
        until = self.now() + timeout
        while not (self._in and self._in[0][0] <= self.now()) and self.now() < until:
            due = min([until, *(queue[0][0] for queue in (self._out, self._in) if queue)])
            self.board.run_until(due)
            self._deliver()
        came = b""
        while self._in and self._in[0][0] <= self.now():
            came += self._in.popleft()[1]
        return came

    def now(self) -> float:
        """Return the arm's time [s]."""
        return self.board.time

    def sleep_until(self, time: float) -> None:
        """Let the arm's time pass until ``time`` [s], or a little later where the arm has that of a host."""
        while self._out and self._out[0][0] < time:
            self.board.run_until(self._out[0][0])
            self._deliver()
        self.board.run_until(time, late=True)

    def close(self) -> None:
        """Close the arm."""
        self.board.arm.close()

    def _deliver(self) -> None:
        """Have the board take what has arrived at it."""
        while self._out and self._out[0][0] <= self.now():
            answer = self.board.receive(self._out.popleft()[1])
            if answer:
                self._in.append((self.now() + self.delay, answer))
