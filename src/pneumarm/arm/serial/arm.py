"""An arm behind a microcontroller that speaks the protocol."""

import logging
import secrets
from collections import deque
from contextlib import suppress
from dataclasses import asdict, replace
from typing import NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import Arm, ArmSpec, Reading, with_measured
from pneumarm.arm.serial.clock import BoardClock
from pneumarm.arm.serial.line import Line
from pneumarm.arm.serial.link import ADVICE, Answer, Link
from pneumarm.arm.serial.protocol import (
    ANY_OVER_PRESSURE,
    EXTRAS,
    HIGHEST_COUNT,
    HOLD,
    JOINTS,
    LATCHES,
    LONGEST_PULSE,
    MUSCLES,
    OLDEST_VERSION,
    OVER_PRESSURE,
    PULSES_SINCE,
    SEQUENCES,
    VELOCITY_SCALE,
    VERSION,
    Cause,
    Code,
    Flag,
    Hello,
    Reason,
    Refused,
    Reply,
    Request,
    Sensors,
    Status,
    pack_valves,
    pulse_lengths,
    said_twice,
    summed,
    unpack_valves,
)
from pneumarm.errors import ArmFailure, LineLost, UnusableInput

CONVERSIONS = 5
"""Conversions of which the board sends the median (thesis A.1.3)."""
VELOCITY_MS = 16
"""Time over which the board averages the velocity [ms] (thesis 5.1, 7.3)."""
CUT_OFF = 1.5
"""The board cuts a muscle off at so many times ``spec.max_pressure``; moving closed ones compresses them."""
FED = 0.1
"""While waiting the command is sent again this often [s], so that the board's dead-man is fed."""
NUMBERS = 256
"""Numbers of commands before they begin again."""
BOOT = 3.0
"""Longest time to wait for a board that opening the port has reset [s]."""
KNOCK = 0.1
"""Time between two CONNECTs to a board that may still be booting [s]."""
LOSSES = 5
"""Losses of the line within a minute that are made good; at one more whoever moves the arm gives up."""
AWAY = 600.0
"""Longest time to look for a board whose line was lost [s]."""
_LOOK = 1.0  # s between two looks for it
_MINUTE = 60.0  # s
_BOOTS = 1 << 16  # the board's count of its restarts begins again
_MOST_BOOTS = 256  # of one board while its line was lost: each time that the port is opened may restart it
_log = logging.getLogger("pneumarm")
_CAUSES = {
    Cause.POWER_ON: "power on",
    Cause.EXTERNAL: "reset pin",
    Cause.BROWN_OUT: "supply too low",
    Cause.WATCHDOG: "its program hung",
}


class _Command(NamedTuple):
    """What the board was last told to do with the valves; it is told again while waiting."""

    request: Request
    values: tuple[int, ...]
    valves: int
    """As they are set, a byte of codes."""
    pulses: tuple[int, ...] = ()
    """Muscles that close by themselves, from 0."""

    def agrees(self, applied: int) -> bool:
        """Return whether the valves ``applied`` are those told; pulses may be over."""
        for muscle in range(MUSCLES):
            told, code = self.valves >> 2 * muscle & 3, applied >> 2 * muscle & 3
            if code != told and not (muscle in self.pulses and code == Code.CLOSED):
                return False
        return True


def _whole(valves: NDArray[np.int8]) -> _Command:
    """Return the command that sets ``valves`` (joints, 2) until the next one."""
    packed = pack_valves(valves)
    return _Command(Request.EXCHANGE, said_twice(packed), packed)


class SerialArm(Arm):
    """An arm on a serial line. It is connected, configured and armed on opening; closing vents it.

    The board times pulses. One of an older protocol cannot, and the guard does.

    Whatever the board does by itself (vents a muscle over its limit, vents all when the host is silent,
    restarts) makes the next :meth:`set_valves` fail and stays until :meth:`rearm`, or until :meth:`make_ready` before
    a movement where only the silence of this host was the cause. After that, and after a lost line, :meth:`regain`
    takes up the same board with the same firmware, and no other.

    Args:
        line: to the board; it is opened again by :meth:`rearm` if it failed.
        spec: what the arm is.
        conversions: 5, 7 or 9, of which each value is the median.
        velocity_ms: time over which the board averages the velocity [ms].
        cut_off: pressure [bar] at which the board cuts a muscle off; 1.5 times ``spec.max_pressure`` by default.
        losses: most losses of the line within a minute after which :meth:`regain` takes the arm up again.

    Raises:
        UnusableInput: more joints or sensors than the board has pins for, or a board of another protocol.
        ArmFailure: no board answers, or it finds the arm unfit to move.

    """

    def __init__(
        self,
        line: Line,
        spec: ArmSpec,
        *,
        conversions: int = CONVERSIONS,
        velocity_ms: int = VELOCITY_MS,
        cut_off: float | None = None,
        losses: int = LOSSES,
    ) -> None:
        if spec.joints > JOINTS:
            raise UnusableInput(f"{spec.name}: a board has pins for {JOINTS} joints, not for {spec.joints}")
        for one in spec.sensors:
            if one.channel is None or one.channel > EXTRAS:
                raise UnusableInput(
                    f"{spec.name}: {one.name} needs one of the board's {EXTRAS} extra channels, its spec says "
                    f"{one.channel}; correct it, or leave the sensor out"
                )
        self.spec = spec
        self.link = Link(line, spec.period, spec.name, secrets.randbelow(SEQUENCES))
        self.hello: Hello | None = None
        """What the board said of itself when it was connected."""
        self._line = line
        self._clock = BoardClock()
        self._closed_valves = np.zeros((spec.joints, 2), np.int8)
        self._command = _whole(self._closed_valves)
        self._number = 0
        self._fed = line.now()
        self._closed = False
        limit = min(round((cut_off or CUT_OFF * spec.max_pressure) * spec.counts_per_bar), HIGHEST_COUNT)
        if not spec.pressure_sensors:
            limit = HIGHEST_COUNT  # what pins read that nothing is wired to means nothing
        self._settings = (conversions, velocity_ms, *[limit] * MUSCLES)
        self._limit = limit / spec.counts_per_bar
        self._session = 0
        self._losses, self._lost_at = losses, deque[float](maxlen=losses + 1)
        self._known: Hello | None = None  # what the board said of itself before it was armed
        self._reopened = False  # the line, since then
        try:
            self._connect()
            self._arm()
        except BaseException:
            line.close()
            raise

    def read(self) -> Reading:
        """Return the sensors of one moment, and that moment on the host's clock.

        Raises:
            ArmFailure: the link is lost, or the board restarted.

        """
        return self._reading(self.link.ask(Request.READ))

    def set_valves(self, valves: NDArray[np.int8]) -> None:
        """Set the valves (joints, 2) of -1, 0, +1.

        Raises:
            ArmFailure: the board did not do so, and why.

        """
        self._tell(_whole(np.asarray(valves, np.int8).reshape(self.spec.joints, 2)))

    def set_pulses(self, command: NDArray[np.float64]) -> bool:
        """Open the valves (joints, 2); the board closes each after its share of the control period.

        Returns:
            Whether it does: not one of an older protocol, and no pulse that is longer than its dead-man waits.

        Raises:
            ArmFailure: the board did not open them, and why.

        """
        lengths = pulse_lengths(command, self.spec.period)
        pulses = tuple(muscle for muscle, length in enumerate(lengths) if 0 < length < HOLD)
        if self.version < PULSES_SINCE or any(lengths[muscle] > LONGEST_PULSE for muscle in pulses):
            return False
        # A command that is sent again keeps its number, so that it does not begin again.
        self._number = (self._number + 1) % NUMBERS
        packed = pack_valves(np.sign(command))
        self._tell(_Command(Request.PULSE, summed(self._number, packed, *lengths), packed, pulses))
        return True

    def wait(self, seconds: float) -> None:
        """Let time pass [s] on the host's clock; the valves hold."""
        self.wait_until(self._line.now() + seconds)

    def wait_until(self, time: float) -> None:
        """Let time pass until ``time`` [s] on the host's clock; the valves hold."""
        while True:
            due = self._fed + FED
            if due >= time or not self._armed:
                break
            self._line.sleep_until(due)
            self._tell(self._command)
        self._line.sleep_until(time)

    def make_ready(self) -> None:
        """Arm the board if it vented the arm only because nobody moved it for a while.

        Raises:
            ArmFailure: it was something else.

        """
        flags = self._status(self.link.ask(Request.READ))
        if flags & LATCHES & ~Flag.DEAD_MAN:
            self._fail(flags)
        if not flags & Flag.ARMED:
            self._arm()

    def regain(self) -> None:
        """Take up the arm after its line was lost, or after its dead-man vented it; wait for the board if need be.

        ArmFailure where a person has to look: another board, other firmware, a board that restarted by itself, a
        muscle over its limit; or where the line is lost too often, or for too long.
        """
        begun, why = self._line.now(), self.link.lost or "its dead-man vented the arm"
        self._lost_at.append(begun)
        if len(self._lost_at) > self._losses and begun - self._lost_at[0] <= _MINUTE:
            raise self.link.lose(
                f"the line was lost {len(self._lost_at)} times within a minute ({why}); check cable, plug and power, "
                f"or allow more losses a minute (an arm called NAME,losses=N; now {self._losses})",
                ArmFailure,
            )
        _log.warning("%s: %s; looking for the board", self.spec.name, why)
        while True:
            try:
                self._take_up()
                break
            except LineLost as error:
                if self._line.now() - begun >= AWAY:
                    raise self.link.lose(
                        f"the board was not found again within {AWAY / 60:g} min ({error}); {ADVICE}", ArmFailure
                    ) from error
            self._line.sleep_until(self._line.now() + _LOOK)
        self.link.counts.losses += 1
        _log.warning("%s: taken up again after %.1f s", self.spec.name, self._line.now() - begun)

    def _take_up(self) -> None:
        """Arm the board again, connecting first if the link is lost."""
        if self.link.lost is None:
            self.make_ready()
            return
        latched = self._connect() & LATCHES & ~Flag.DEAD_MAN
        wrong = self._unlike()
        if wrong is not None:
            raise self.link.lose(f"{wrong}, and stays vented; check it and run the same command again", ArmFailure)
        if latched:
            self._fail(latched)
        self._arm()

    def _unlike(self) -> str | None:
        """Return why the board that is connected may not be taken up for the one before; None where it may."""
        before, now = self._known, self.hello
        if before is None or now is None:
            return "no board was connected before"
        boots = (now.boots - before.boots) % _BOOTS
        if now.firmware != before.firmware or boots > _MOST_BOOTS:
            return "another board, or one with other firmware, answers"
        causes = Cause(now.reset_cause)
        told = bool(causes & (Cause.POWER_ON | Cause.EXTERNAL)) or (not causes and self._reopened)
        if boots and (causes & Cause.WATCHDOG or not told):
            return f"the board restarted by itself ({', '.join(self.reset_causes()) or 'nobody knows why'})"
        return None

    def rearm(self) -> None:
        """Connect again, opening the line again if it had failed, and arm: a person has looked at the arm.

        Raises:
            ArmFailure: a cause remains.

        """
        self._connect()
        self._arm()

    def close(self) -> None:
        """Vent all muscles, disarm, and let go of the line."""
        if self._closed:
            return
        self._closed = True
        try:
            if self.link.lost is None:
                self.link.ask(Request.DISARM)
        except ArmFailure:
            pass  # who is not heard lets the board vent by itself
        finally:
            self._line.close()

    def _connect(self) -> Flag:
        """Have a board that may still be booting answer, then configure it; return its flags."""
        self._armed = False
        begun = self._line.now()
        while True:
            try:
                self._greet()
                break
            except OSError as error:
                raise self.link.lose(f"the line is gone ({error})") from error
            except ArmFailure as error:
                if self.link.broken:
                    raise
                if self._line.now() - begun >= BOOT:
                    self.link.broken = True  # a driver may hang, so that it has to be opened again
                    raise LineLost(
                        f"{self.spec.name}: nobody answered for {BOOT:g} s. Is this the right port, is the "
                        "board powered, is pneumarm's firmware on it?"
                    ) from error
        self._clock = BoardClock()
        return self._status(self.link.ask(Request.CONFIGURE, *self._settings))

    def _greet(self) -> None:
        """Begin a session, on a line that works."""
        if self.link.broken:
            self._line.reopen()
            self._reopened = True
        self.link.begin()
        self._line.write(b"\0")  # ends whatever an earlier host left unfinished
        self._session = secrets.randbits(32)
        for version in range(VERSION, OLDEST_VERSION - 1, -1):
            frame = self.link.knock(Request.CONNECT, version, self._session, wait=KNOCK).frame
            if frame.kind == Reply.HELLO and frame.values[0] == version:
                self.hello = Hello(*frame.values)
                return
        raise UnusableInput(
            f"{self.spec.name}: the board speaks another protocol than versions {OLDEST_VERSION} to {VERSION}; "
            "flash the firmware that came with this pneumarm"
        )

    @property
    def version(self) -> int:
        """Version of the protocol that the board speaks."""
        return OLDEST_VERSION if self.hello is None else self.hello.version

    def _arm(self) -> None:
        self._status(self.link.ask(Request.ARM, self._session))
        self._armed = True
        self._known, self._reopened = self.hello, False
        self._command = _whole(self._closed_valves)
        self._fed = self._line.now()

    def _tell(self, command: _Command) -> None:
        """Have the board carry out ``command``, or go on with it where it was told already."""
        answer = self.link.ask(command.request, *command.values)
        flags = self._status(answer)
        sensors = Sensors.of(answer.frame.values)
        if flags & LATCHES:
            self._fail(flags)
        if not command.agrees(sensors.valves):
            asked, applied = (unpack_valves(packed, self.spec.joints) for packed in (command.valves, sensors.valves))
            raise ArmFailure(f"{self.spec.name}: valves {asked} were asked for, {applied} are set")
        self._command = command
        self._fed = answer.sent

    def _reading(self, answer: Answer) -> Reading:
        self._status(answer)
        sensors = Sensors.of(answer.frame.values)
        joints = self.spec.joints
        reading = Reading(
            self._clock.map(sensors.time, answer.sent, answer.received),
            np.array(sensors.angle[:joints], np.float64),
        )
        if self.spec.pressure_sensors:
            pressure = np.array(sensors.pressure[: 2 * joints], np.float64).reshape(joints, 2)
            reading = replace(reading, pressure=pressure)
        velocity = [value / VELOCITY_SCALE for value in sensors.velocity[:joints] if self.spec.velocity_sensor]
        further = [one.value(sensors.extra[(one.channel or 1) - 1]) for one in self.spec.sensors]
        return with_measured(reading, self.spec, [*velocity, *further])

    def _status(self, answer: Answer) -> Flag:
        """Return the flags of an answer that is no refusal."""
        kind, values = answer.frame.kind, answer.frame.values
        if kind == Reply.REFUSED:
            self._refused(Refused(*values))
        if kind == Reply.STATUS:
            return Flag(Status(*values).flags)
        if kind == Reply.READING:
            return Flag(values[1])
        return Flag(0)

    def _refused(self, refused: Refused) -> NoReturn:
        flags = Flag(refused.flags)
        if refused.reason in (Reason.NOT_CONNECTED, Reason.NOT_ARMED):
            self._armed = False
        if refused.reason == Reason.NOT_CONNECTED:
            self._restarted()
        if flags & LATCHES or refused.reason == Reason.CAUSE_REMAINS:
            self._fail(flags)
        reasons = {int(reason): reason.name.lower().replace("_", " ") for reason in Reason}
        why = reasons.get(refused.reason, f"reason {refused.reason}")
        raise ArmFailure(f"{self.spec.name}: the board refused: {why}")

    def _restarted(self) -> NoReturn:
        """Ask the board why it restarted, and raise that; nothing more is asked until :meth:`rearm`."""
        with suppress(OSError, ArmFailure):  # then it says so the next time
            self._greet()
        causes = f" ({', '.join(self.reset_causes())})" if self.link.lost is None and self.reset_causes() else ""
        raise self.link.lose(
            f"the board restarted while in use{causes}, all muscles are vented; check its power, its plug "
            "and, after a hang, its firmware",
            ArmFailure,
        )

    def _fail(self, flags: Flag) -> NoReturn:
        """Raise what a latch means."""
        if flags & ANY_OVER_PRESSURE:
            muscles = [
                f"muscle {muscle % 2 + 1} of joint {muscle // 2 + 1}"
                for muscle, flag in enumerate(OVER_PRESSURE)
                if flags & flag
            ]
            raise ArmFailure(
                f"{self.spec.name}: the board cut off {' and '.join(muscles)}, which read over "
                f"{self._limit:.2f} bar; check its inlet valve and the supply"
            )
        if flags & Flag.CONVERTER:
            raise ArmFailure(f"{self.spec.name}: the board's converter stopped, all muscles are vented")
        self._armed = False
        raise LineLost(
            f"{self.spec.name}: the board heard nothing for a quarter of a second and vented all muscles; "
            "this computer was too busy or asleep, or the line or the board was silent for so long"
        )

    def link_counts(self) -> dict[str, int]:
        """Return what has happened on the link so far."""
        return asdict(self.link.counts)

    def reset_causes(self) -> list[str]:
        """Return why the board last restarted, in words; several may be true."""
        causes = Cause(self.hello.reset_cause) if self.hello is not None else Cause(0)
        return [text for cause, text in _CAUSES.items() if causes & cause]
