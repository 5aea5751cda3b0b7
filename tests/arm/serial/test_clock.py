"""The controller's clock on the host's: wraps, pauses, drift; and nothing asks for the time on the wall."""

import ast
import random
import time
from pathlib import Path

import numpy as np
import pytest
from tests.arm.serial.wired import all_valves, wired

import pneumarm.arm
from pneumarm.arm.serial.clock import WRAP, BoardClock

ROUND_TRIP = 1e-3


def mapped(times: list[float], rate: float, begin: int, seed: int = 0) -> np.ndarray:
    """Return the errors [s] of readings at host's ``times`` [s] by a clock that runs ``rate`` times as fast."""
    rng, clock, errors = random.Random(seed), BoardClock(), []
    for moment in times:
        before, after = (ROUND_TRIP / 2 + (rng.random() < 0.1) * rng.expovariate(1 / 0.003) for _ in range(2))
        raw = (round(1e6 * rate * moment) + begin) % WRAP
        errors.append(clock.map(raw, moment - before, moment + after) - moment)
    return np.array(errors)


@pytest.mark.parametrize("rate", [0.995, 1.0, 1.0003, 1.005])
def test_drift_and_wraps_are_followed(rate: float) -> None:
    times = [k / 30 for k in range(3000)]
    errors = mapped(times, rate, begin=WRAP - 50_000_000)  # wraps after 50 s
    assert np.abs(errors[300:]).max() < 0.2e-3
    assert np.std(np.diff(errors[300:])) < 0.05e-3


@pytest.mark.parametrize("pause", [60.0, 4_290.0, 4_295.0, 7_200.0, 10_000.0, 86_400.0])
def test_wraps_in_a_pause_are_counted(pause: float) -> None:
    times = [k / 30 + (pause if k >= 1000 else 0) for k in range(2000)]
    errors = mapped(times, 1.003, begin=WRAP // 3)
    assert np.abs(errors[300:]).max() < 5e-3
    assert np.abs(errors[1100:]).max() < 0.5e-3


def test_mapped_times_never_go_back_and_lie_in_their_exchange() -> None:
    rng, clock, last = random.Random(3), BoardClock(), -1.0
    for k in range(2000):
        moment = k / 100
        before, after = rng.expovariate(1 / 0.005), rng.expovariate(1 / 0.005)
        found = clock.map(round(1e6 * moment), moment - before, moment + after)
        assert last <= found <= moment + after
        last = found


def test_mapped_times_do_not_go_back_when_more_is_known() -> None:
    """The first reply came late, so that its time was taken for later than it was; the next tells."""
    clock = BoardClock()
    first = clock.map(1_000_000, 1.0, 1.1)
    assert first == pytest.approx(1.05)
    assert clock.map(1_010_000, 1.0095, 1.0105) == first
    assert clock.map(1_200_000, 1.1995, 1.2005) == pytest.approx(1.2, abs=1e-3)


def test_nothing_under_the_seam_asks_for_the_time_on_the_wall() -> None:
    for path in Path(pneumarm.arm.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = {alias.name for alias in node.names} if isinstance(node, ast.ImportFrom | ast.Import) else set()
            assert not names & {"datetime"}, path
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "time":
                assert node.attr in ("monotonic", "sleep"), path
            if isinstance(node, ast.ImportFrom) and node.module == "time":
                assert names <= {"monotonic", "sleep"}, path


def test_a_clock_on_the_wall_that_jumps_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def run(jumps: bool) -> list[float]:
        if jumps:
            rng = random.Random(1)
            monkeypatch.setattr(time, "time", lambda: rng.uniform(-1e9, 1e9))
        w, times = wired(), []
        for k in range(60):
            reading = w.arm.read()
            times.append(reading.time)
            w.arm.set_valves(all_valves(w.arm, k % 3 - 1))
            w.arm.wait_until(reading.time + 1 / 30)
        return times

    steady = run(jumps=False)
    assert run(jumps=True) == steady
    assert (np.diff(steady) > 0).all()


def test_times_rise_though_the_controller_s_clock_stands_still() -> None:
    """As that of an emulated board does on a computer that is too busy for it."""
    clock = BoardClock()
    times = [clock.map(5_000, sent, sent + 1e-3) for sent in np.arange(0.0, 1.0, 1 / 60)]
    assert (np.diff(times) > 0).all()
    assert times == pytest.approx(np.arange(0.0, 1.0, 1 / 60), abs=1.1e-3)
