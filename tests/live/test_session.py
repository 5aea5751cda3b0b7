"""The loop that moves an arm for people: goals, curves, stops, faults, silence, failures. No time is waited for."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from children import wait_until
from pneumarm.arm import Reading, open_arm
from pneumarm.arm.virtual import VirtualArm
from pneumarm.arm.wrapper import ArmWrapper
from pneumarm.control import Monitor
from pneumarm.errors import ArmFailure, UnusableInput
from pneumarm.live.choices import Choice, opened
from pneumarm.live.lease import HOLD_AFTER, VENT_AFTER
from pneumarm.live.live_arm import LiveArm
from pneumarm.live.orders import Faults, FollowCurve, GoTo, Hold, Order, Relax, Release, Stop, Take
from pneumarm.live.screen import Screen
from pneumarm.live.session import Mode, Session
from pneumarm.run import RunSettings


class Scripted(ArmWrapper):
    """A virtual arm whose reads are told: what happens at which of its times is laid down."""

    def __init__(self, arm: VirtualArm) -> None:
        super().__init__(arm)
        self.script: list[tuple[float, Callable[[], None]]] = []
        self.angles: list[float] = []
        self.times: list[float] = []
        self.valves: list[NDArray[np.int8]] = []

    def read(self) -> Reading:
        reading = self.arm.read()
        while self.script and reading.time >= self.script[0][0]:
            self.script.pop(0)[1]()
        self.times.append(reading.time)
        self.angles.append(float(self.spec.degrees(reading.angle)[0]))
        return reading

    def set_valves(self, valves: NDArray[np.int8]) -> None:
        self.valves.append(valves.copy())
        self.arm.set_valves(valves)

    def at(self, time: float) -> float:
        """Return the angle [degrees] read last before ``time``."""
        return self.angles[int(np.searchsorted(self.times, time)) - 1]


class Played:
    """A session and what happens in it, at times of the arm."""

    def __init__(self, pid: Path) -> None:
        arm = open_arm("virtual:seed=3")
        assert isinstance(arm, VirtualArm)
        self.virtual, self.arm = arm, Scripted(arm)
        mover = opened(Choice("pid", str(pid)), arm)
        self.silence, self.screen = 0.0, Screen()
        self.session = Session(self.arm, mover, Monitor(arm.spec), self.screen, lambda: self.silence)
        self.modes: list[tuple[float, str, str]] = []

    def run(self, *script: tuple[float, Order | Callable[[], None]], until: float) -> None:
        """Do what the ``script`` says at times [s] after the beginning, ``until`` the end."""
        begin = self.virtual.time
        for time, what in script:
            do = (lambda order: lambda: self.session.order(order))(what) if isinstance(what, Order) else what
            self.arm.script.append((begin + time, do))
            self.arm.script.append((begin + time + 0.2, self.note))
        self.arm.script.append((begin + until, self.session.leave))
        self.arm.script.sort(key=lambda one: one[0])
        self.session.run()

    def note(self) -> None:
        state = self.screen.state
        self.modes.append((self.virtual.time, state["mode"], state["why"]))

    def be_silent(self, seconds: float) -> Callable[[], None]:
        def silent() -> None:
            self.silence = seconds

        return silent


@pytest.fixture
def played(pid: Path) -> Iterator[Played]:
    played = Played(pid)
    with played.virtual:
        yield played


VENTED = [[-1, -1]]


def test_the_arm_is_seen_before_its_monitor_is_compiled(pid: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    live_arm = LiveArm(RunSettings(arm="virtual:seed=3"), [str(pid)], None)
    seen: list[object] = []
    monkeypatch.setattr("pneumarm.live.session.warm_up_watch", lambda *_: seen.append(live_arm.screen.state["mode"]))
    assert json.loads(live_arm.screen.frame)["goal"] is None
    with live_arm:
        wait_until("it is ready", lambda: live_arm.screen.state["mode"] == "relaxed")
    assert seen == ["opening"]


def test_only_the_page_that_controls_the_arm_moves_it_and_any_page_stops_it(pid: Path) -> None:
    live_arm = LiveArm(RunSettings(arm="virtual:seed=3"), [str(pid)], None)  # nothing moves yet
    writer, watcher = live_arm.lease.enter(), live_arm.lease.enter()
    live_arm.order(writer, Take())
    live_arm.order(writer, GoTo([10.0]))
    for order in (GoTo([10.0]), Hold(), Relax(), Release(), FollowCurve([0.0, 1.0], [[0.0], [0.0]])):
        with pytest.raises(UnusableInput, match="another page controls the arm"):
            live_arm.order(watcher, order)
    live_arm.order(watcher, Stop())
    assert live_arm.lease.writer == writer


def test_of_an_arm_with_one_muscle_nothing_else_is_shown() -> None:
    with open_arm("virtual:seed=3,muscles=1") as arm:
        screen = Screen()
        screen.show(arm.spec, arm.read(), None, np.array([[1, -1]]))
    assert np.shape(json.loads(screen.frame)["pressure"]) == np.shape(json.loads(screen.frame)["valves"]) == (1, 1)


def test_goals_are_moved_to_held_and_counted(played: Played) -> None:
    played.run((0.1, GoTo([15.0])), (4.0, GoTo([-10.0])), (8.0, GoTo([1e6])), until=12.0)
    assert played.arm.at(3.9) == pytest.approx(15, abs=2)
    assert played.arm.at(7.9) == pytest.approx(-10, abs=2)
    assert 20 < played.arm.at(11.9) < 60  # as far as it has been seen to go
    assert {mode for _, mode, _ in played.modes} == {"moving"}
    assert played.screen.state["figures"]["pid"]["goals"] == 3
    assert played.arm.valves[-1].tolist() == VENTED


def test_a_curve_is_followed_and_its_end_held(played: Played) -> None:
    times = np.linspace(0, 3, 31)
    curve = FollowCurve(times.tolist(), (10 * np.sin(np.pi * times))[:, None].tolist())
    played.run((0.1, GoTo([5.0])), (3.0, curve), until=9.0)
    begin = 3.0 + 1.0
    off = [played.arm.at(begin + time) - 10 * np.sin(np.pi * time) for time in times]
    assert np.sqrt(np.mean(np.square(off))) < 3
    assert played.arm.at(8.9) == pytest.approx(0, abs=2)
    assert played.screen.state["figures"]["pid"]["curve"] < 3


def test_a_curve_that_has_ended_is_no_longer_followed(played: Played) -> None:
    curve = FollowCurve([0.0, 1.0], [[10.0], [10.0]])
    played.run((0.1, curve), (3.0, lambda: None), (4.0, GoTo([-10.0])), until=7.0)
    assert [mode for _, mode, _ in played.modes] == ["following", "holding", "moving"]
    assert played.arm.at(3.9) == pytest.approx(10, abs=2)
    assert played.arm.at(6.9) == pytest.approx(-10, abs=2)


def test_a_stop_vents_and_stays_until_it_is_released(played: Played) -> None:
    played.run(
        (0.1, GoTo([15.0])), (3.0, Stop()), (4.0, GoTo([0.0])), (5.0, Release()), (6.0, GoTo([0.0])), until=9.0
    )
    assert [mode for _, mode, _ in played.modes] == ["moving", "stopped", "stopped", "relaxed", "moving"]
    assert played.arm.at(8.9) == pytest.approx(0, abs=2)
    assert "release" in played.screen.state["notice"]


def test_only_a_release_ends_a_stop(played: Played) -> None:
    played.run((0.1, GoTo([15.0])), (1.0, Stop()), (2.0, Relax()), (3.0, GoTo([15.0])), until=4.0)
    assert [mode for _, mode, _ in played.modes] == ["moving", "stopped", "stopped", "stopped"]
    assert played.virtual.pressure.max() < 5e3


def test_a_stop_outlasts_a_board_that_has_vented_by_itself(played: Played, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pneumarm.live.session.unwrapped", lambda *_: played.virtual)  # which has no board

    def not_heard() -> None:
        raise ArmFailure("this computer was too busy")

    played.run((0.1, GoTo([15.0])), (1.0, not_heard), (2.0, Stop()), (3.0, not_heard), (4.0, GoTo([0.0])), until=5.0)
    assert [mode for _, mode, _ in played.modes][1:] == ["relaxed", "stopped", "stopped", "stopped"]


def test_hold_stays_where_the_arm_is_and_relax_lets_the_air_out(played: Played) -> None:
    played.run((0.1, GoTo([20.0])), (0.4, Hold()), (4.0, Relax()), until=7.0)
    assert played.arm.at(3.9) == pytest.approx(played.arm.at(0.45), abs=6)
    assert played.virtual.pressure.max() < 5e3
    assert played.modes[-1][1] == "relaxed"


def test_an_arm_whose_page_is_silent_holds_then_is_vented(played: Played) -> None:
    played.run(
        (0.1, GoTo([15.0])),
        (3.0, played.be_silent(HOLD_AFTER)),
        (5.0, played.be_silent(VENT_AFTER)),
        until=7.0,
    )
    (_, first, _), (_, second, why), (_, third, after) = played.modes
    assert (first, second, third) == ("moving", "moving", "relaxed")
    assert "lost its connection" in why
    assert "vented" in after
    assert played.virtual.pressure.max() < 5e3


def test_an_arm_on_its_way_stops_where_it_is_when_its_page_falls_silent(played: Played) -> None:
    played.run(
        (0.1, GoTo([20.0])),
        (4.0, GoTo([-20.0])),
        (4.2, played.be_silent(HOLD_AFTER)),
        until=6.5,
    )
    begin = played.arm.times[0]
    stopped = played.arm.at(begin + 4.25)
    assert played.arm.at(begin + 6.4) == pytest.approx(stopped, abs=8)
    assert stopped > -5


def test_a_fault_is_switched_on_found_and_switched_off(played: Played) -> None:
    goals = [(1.0 + k, GoTo([15.0 if k % 2 else -15.0])) for k in range(50)]
    on, off = Faults("inlet-closed", 1, 1, True), Faults("inlet-closed", 1, 1, False)
    played.run(*goals, (25.05, on), (48.0, off), until=51.0)  # after 20 s it knows the arm
    kinds = {one.kind for one in played.session._watch.findings if one.since > 24}
    assert "stuck-valve" in kinds
    told = [words for words, _, _ in played.screen.state["was_wrong"] + played.screen.state["wrong"]]
    assert "Muscle 1: the inlet is stuck closed" in told
    assert played.screen.state["familiar"]
    assert played.virtual.faults == ()


def test_an_arm_whose_angle_nobody_knows_is_stopped_and_says_so(played: Played) -> None:
    goals = [(1.0 + k, GoTo([15.0 if k % 2 else -15.0])) for k in range(40)]
    on, off = Faults("dead-potentiometer", 1, 0, True), Faults("dead-potentiometer", 1, 0, False)
    blind: list[list[int]] = []
    vented: list[list[list[int]]] = []
    played.run(
        *goals,
        (25.05, on),
        (30.0, lambda: blind.append(played.session._blind)),
        (30.5, lambda: vented.append(played.arm.valves[-1].tolist())),
        (31.0, off),
        (36.0, Release()),
        (37.0, lambda: blind.append(played.session._blind)),
        until=40.0,
    )
    stopped = [why for time, mode, why in played.modes if mode == Mode.STOPPED]
    assert stopped[0] == "stopped: where joint 1 is, nobody knows; see to its angle sensor"
    assert vented == [VENTED]
    assert blind == [[1], []]
    assert played.modes[-1][1] == Mode.MOVING


def test_what_cannot_be_done_is_said(played: Played) -> None:
    played.run((0.1, Faults("leak", 7, 1, True)), until=1.0)
    assert "joint 7" in played.screen.state["notice"]


def test_a_failure_waits_for_a_release(played: Played) -> None:
    reads = played.arm.read

    def fail() -> None:
        def broken() -> Reading:
            played.arm.read = reads  # type: ignore[method-assign]
            played.session.order(Release())
            raise ArmFailure("the plug fell out")

        played.arm.read = broken  # type: ignore[method-assign]

    shown: list[object] = []
    tell = played.screen.tell
    played.screen.tell = lambda **state: (shown.append(state.get("mode")), tell(**state))[1]  # type: ignore[method-assign]
    played.run((0.1, GoTo([15.0])), (2.0, fail), (3.0, GoTo([5.0])), until=5.0)
    assert Mode.FAILED in shown
    assert played.arm.at(4.9) == pytest.approx(5, abs=2)
