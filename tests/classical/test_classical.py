"""Classical controllers: their parts by properties, and tuning on a virtual arm."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pneumarm import load_controller
from pneumarm.arm import ArmSpec, guarded, open_arm
from pneumarm.arm.reference import Reference
from pneumarm.classical import KINDS, Tuned, TuneSettings, load_tuned, tune
from pneumarm.classical.cascade import Cascade, CascadeGains
from pneumarm.classical.following import Setpoint, _QuinticProfile
from pneumarm.classical.pressure_loop import PressureLoop, Rates
from pneumarm.classical.ranges import RANGES
from pneumarm.classical.search import Evolution
from pneumarm.classical.static_map import fit_map
from pneumarm.errors import UnusableInput
from pneumarm.moving import MoveSettings, at_period, move, track

SPEC = ArmSpec()
RATES = Rates((0.0, 0.5, 1.0), (2.0, 2.0, 1.0), (0.5, 2.0, 4.0), dead_time=0.01)
RATIOS = (-1.0, -0.5, 0.0, 0.5, 1.0)


def points(slope: float = 400.0) -> tuple[np.ndarray, np.ndarray]:
    grid = [(s * (1 + r) / 2, s * (1 - r) / 2) for s in (0.4, 0.8, 1.2) for r in np.linspace(-0.9, 0.9, 9)]
    pressures = np.array(grid)
    ratio = (pressures[:, 0] - pressures[:, 1]) / pressures.sum(axis=1)
    return pressures, 500 + slope * ratio + 20 * pressures.sum(axis=1)


@pytest.fixture(scope="module")
def tuned() -> Tuned:
    """A controller tuned on arm 3 with barely enough time."""
    with open_arm("virtual:seed=3") as arm:
        return tune("pid", arm, TuneSettings(seconds=420))


def test_the_map_and_its_inverse_agree_and_rise() -> None:
    pressures, angles = points()
    static_map = fit_map(pressures, angles, (0.4, 0.8, 1.2), RATIOS, 1.0)
    for (first, second), angle in zip(pressures, angles, strict=True):
        assert static_map.angle(first, second) == pytest.approx(angle, abs=6)
        if max(first, second) < 1:
            back = static_map.pressures(static_map.angle(first, second), first + second)
            np.testing.assert_allclose(back, (first, second), atol=1e-6)
    assert all((np.diff(row) > 0).all() for row in static_map.angles)
    falling = fit_map(pressures, 1000 - angles, (0.4, 0.8, 1.2), RATIOS, 1.0)
    assert all((np.diff(row) > 0).all() for row in falling.angles)
    assert max(static_map.pressures(2000.0, 1.2)) <= 1.0 + 1e-9


def test_an_unseen_command_is_added_to_what_is_read() -> None:
    loop = PressureLoop(RATES, 0.01, 0.005, None, gain=1.0, dead_band=0.0, trust=1.0)
    assert loop.read(0.2) == pytest.approx(0.2)
    loop.commanded(1.0)  # opens 5 ms after the reading, takes effect 10 ms later, for 10 ms
    assert loop.read(0.2) == pytest.approx(0.2 + 2.0 * 0.010)
    loop.commanded(0.0)
    assert loop.read(0.21) == pytest.approx(0.21 + 2.0 * 0.005)
    loop.commanded(0.0)
    assert loop.read(0.22) == pytest.approx(0.22)


def test_a_pressure_is_trusted_less_while_the_joint_stands_still() -> None:
    loop = PressureLoop(RATES, 0.01, 0.005, None, gain=1.0, dead_band=0.0, trust=0.25)
    loop.read(0.2)
    loop.commanded(0.0)
    assert loop.read(0.3) == pytest.approx(0.225)
    loop.commanded(0.0)
    assert loop.read(0.3, motion=1.0) == pytest.approx(0.3)


def test_valves_open_for_what_is_lacking() -> None:
    whole = PressureLoop(RATES, 0.02, 0.0, None, gain=1.0, dead_band=0.0, trust=1.0)
    assert [whole.command(0.4 + d, 0.4) for d in (0.019, 0.021, -0.015, -0.02)] == [0, 1, 0, -1]
    pulses = PressureLoop(RATES, 0.02, 0.0, 0.004, gain=0.5, dead_band=0.002, trust=1.0)
    got = [pulses.command(0.4 + d, 0.4) for d in (0.001, 0.003, 0.01, 0.04, 0.2, -0.2)]
    np.testing.assert_allclose(got, [0, 0, 0.2, 0.5, 1, -1])


def test_the_integral_does_not_wind_up_where_the_joint_cannot_go() -> None:
    static_map = fit_map(*points(), (0.4, 0.8, 1.2), RATIOS, 1.0)
    law = Cascade(SPEC, static_map, (RATES, RATES), CascadeGains(integral=5.0, total=1.0), None)
    law.muscles.begin(500.0, (0.5, 0.5))
    for _ in range(300):  # a stop holds it back, 30 degrees from its goal, with all pressure that there is
        law.muscles.read(560.0, (0.96, 0.04), 0.0)
        law.act(Setpoint(900.0, 900.0, 0.0, 0.0, 0.0), 560.0, 0.0)
    error = static_map.angle(0.96, 0.04) - 560.0
    assert law.muscles.error == pytest.approx(error, rel=0.01)
    assert law.muscles.rest_angle(0.96, 0.04) == pytest.approx(560.0, abs=5)
    law.muscles.read(560.0, (0.96, 0.04), 0.0)  # the way back is taken at once
    assert law.act(Setpoint(400.0, 400.0, 0.0, 0.0, 0.0), 560.0, 0.0) == (-1, 1)


def test_a_moving_joint_teaches_nothing_of_the_map() -> None:
    static_map = fit_map(*points(), (0.4, 0.8, 1.2), RATIOS, 1.0)
    law = Cascade(SPEC, static_map, (RATES, RATES), CascadeGains(memory=0.0), None)
    law.muscles.begin(500.0, (0.5, 0.5))
    law.muscles.read(700.0, (0.5, 0.5), 1.0)
    assert law.muscles.error == 0.0


def test_a_way_meets_both_of_its_ends() -> None:
    way = _QuinticProfile(1.0, 0.5, 10.0, 20.0, -30.0, 100.0)
    np.testing.assert_allclose(way.at(1.0), (10.0, 20.0, -30.0))
    np.testing.assert_allclose(way.at(1.5 - 1e-9), (100.0, 0.0, 0.0), atol=1e-4)
    assert way.at(2.0) == (100.0, 0.0, 0.0)
    step = 1e-5
    for time in (1.1, 1.3):
        before, now, after = way.at(time - step), way.at(time), way.at(time + step)
        assert now[1] == pytest.approx((after[0] - before[0]) / (2 * step), rel=1e-4)
        assert now[2] == pytest.approx((after[1] - before[1]) / (2 * step), rel=1e-4)


def test_the_search_finds_the_least_of_a_bent_valley() -> None:
    search = Evolution(np.full(4, 0.9), 0.2, np.random.default_rng(1))

    def cost(x: np.ndarray) -> float:
        return float(100 * (x[0] - x[1] ** 2) ** 2 + ((x - 0.3) ** 2 * [1, 2, 5, 10]).sum())

    begin = cost(search.mean)
    for _ in range(80):
        asked = search.ask()
        search.tell(asked, [cost(x) for x in asked])
    assert cost(search.mean) < 1e-2 * begin


@pytest.mark.parametrize("kind", KINDS)
def test_the_search_begins_at_the_defaults(kind: str) -> None:
    space = RANGES[kind]
    assert (space.begin >= 0).all()
    assert (space.begin <= 1).all()
    begun = space.gains(space.default, space.begin)
    for name, value in vars(space.default).items():
        assert getattr(begun, name) == pytest.approx(value)


def test_tuning_takes_the_time_it_is_given_and_the_arm_settles(tuned: Tuned) -> None:
    assert 300 < tuned.seconds <= 425
    assert tuned.cost > 0
    low, high = SPEC.degrees(tuned.goal_range[0])
    assert low < -30
    assert high > 30
    goals = [[tuned.goal_range.mean() + degrees * 11.378] for degrees in (0, 20, -20, 5, 25, -10)]
    with open_arm("virtual:seed=3", 5) as arm:
        made = list(move(arm, tuned.controller(), goals, MoveSettings(tolerance=2.2)))
        sine = Reference(lambda time: np.array([511.5 + 20 * 11.378 * np.sin(3 * time)]))
        followed = track(arm, tuned.controller(), sine, 6.0)
    assert all(one.success for one in made)
    assert np.mean([one.rest_error for one in made]) < 0.6
    assert followed.rms_error[0] < 4.0


@pytest.mark.parametrize("kind", KINDS)
def test_all_kinds_come_near_without_any_tuning(tuned: Tuned, kind: str) -> None:
    untuned = replace(tuned, kind=kind, gains=KINDS[kind].gains())
    with open_arm("virtual:seed=3", 5) as arm:
        made = list(move(arm, untuned.controller(), [[650.0], [400.0], [500.0]], MoveSettings(tries=1)))
    assert np.mean([one.rest_error for one in made]) < 3.0


def test_a_file_is_the_controller_and_damaged_ones_are_refused(tuned: Tuned, tmp_path: Path) -> None:
    file = tmp_path / "arm.pid"
    tuned.save(file)
    assert load_tuned(file) == tuned
    controller = load_controller(file)
    controller.reset(np.array([600.0]))
    with open_arm("virtual:seed=3") as arm:
        assert controller.act(arm.read()).shape == (1, 2)
        other = at_period(arm, 0.01)
        other.spec = replace(other.spec, counts_per_bar=100.0)
        with pytest.raises(UnusableInput, match="counts_per_bar"):
            tuned.check_fit(other)
    values = json.loads(file.read_text())
    for name, wrong in (("kind", "none"), ("gains", {"total": "x"}), ("format", "2"), ("spec", [])):
        file.write_text(json.dumps({**values, name: wrong}))
        with pytest.raises(UnusableInput, match="expected a controller"):
            load_tuned(file)
    file.write_text(tuned.kind)
    with pytest.raises(UnusableInput, match="expected"):
        load_tuned(file)


def test_an_unknown_kind_and_a_guarded_arm_are_refused() -> None:
    with open_arm("virtual") as arm:
        with pytest.raises(UnusableInput, match="pid, pwm, sliding, scheduled"):
            tune("fuzzy", arm)
        with pytest.raises(UnusableInput, match="before it is guarded"):
            at_period(guarded(arm), 0.01)
