"""Begin states: which are at rest, and how they are drawn (section 4.3.2, table 4.1, eq. 4.15, 4.16)."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_arm import resting_rows, synthetic_begin_states, synthetic_simulation

from pneumarm.errors import UnusableInput
from pneumarm.learning import Shaping
from pneumarm.random import random_state
from pneumarm.simulation.kernel import scaled_state
from pneumarm.simulation.simulation import Simulation
from pneumarm.task import BeginStates, begin_states
from pneumarm.task.begin import begin_parameters, draw_begin, draw_interval, side_probability
from pneumarm.transitions.rows import Rows
from pneumarm.transitions.window import transitions

DOMAIN = (0.0, 1023.0)


def test_share_of_begin_states_below_the_goal() -> None:
    """The example of the thesis: theta_g = 200 makes lower to higher angles about 0.24 : 1."""
    share = side_probability(200.0, np.array(DOMAIN))
    ratio = 200 / 823
    assert share == pytest.approx(ratio / (ratio + 1))
    assert 1 - share == pytest.approx(1 / (ratio + 1))
    assert ratio == pytest.approx(0.24, abs=0.005)


@pytest.mark.parametrize(
    ("goal", "deviation", "lower", "higher"), [(400.0, 200.0, 200, 200), (200.0, 300.0, 200, 300)]
)
def test_sub_intervals_and_their_probabilities(goal: float, deviation: float, lower: float, higher: float) -> None:
    """Four parts a side with the weights of table 4.1, the farthest most likely; the sides stay in 0..1023."""
    begin = begin_parameters(_line(), DOMAIN, Shaping().weights)
    random, draws = random_state(1), 20_000
    ends = (
        np.array([draw_interval(begin.domain, begin.weights, goal, deviation, random) for _ in range(draws)]) - goal
    )
    found, counts = np.unique(ends.round(6), axis=0, return_counts=True)
    expected = [(-lower * (4 - i) / 4, -lower * (3 - i) / 4) for i in range(4)]
    expected += [(higher * i / 4, higher * (i + 1) / 4) for i in range(4)]
    np.testing.assert_allclose(found, expected, atol=1e-6)
    r = goal / 1023
    weights = [0.4 * r, 0.3 * r, 0.2 * r, 0.1 * r, 0.1 * (1 - r), 0.2 * (1 - r), 0.3 * (1 - r), 0.4 * (1 - r)]
    np.testing.assert_allclose(counts / draws, weights, atol=0.012)


def _line() -> BeginStates:
    simulation = synthetic_simulation()
    angle = np.arange(100.0, 900.0)[:, None]
    return BeginStates(simulation.window, np.zeros((len(angle), 16), np.float32), angle)


@pytest.mark.parametrize("joints", [1, 2])
@pytest.mark.parametrize("deviation", [30.0, 57.0, 200.0, 1023.0])
def test_begin_states_lie_within_the_deviation(joints: int, deviation: float) -> None:
    simulation = synthetic_simulation(joints)
    states = synthetic_begin_states(simulation)
    begin = begin_parameters(states, DOMAIN, Shaping().weights)
    random, goals = random_state(0), np.random.default_rng(0).uniform(400, 620, (500, joints))
    distances = []
    for goal in goals:
        index = draw_begin(begin, goal, deviation, random)
        distances.append(np.abs(states.angle[index] - goal).max())
    if joints == 1 or deviation > 50:  # two joints are seldom both within 30 counts: then the nearest is taken
        assert max(distances) <= deviation
    assert max(distances) > min(0.7 * deviation, 200)


def test_no_joint_leads_the_others() -> None:
    """With the joints' angles and goals exchanged the same distances are drawn."""
    simulation = synthetic_simulation(2)
    states = synthetic_begin_states(simulation)
    exchanged = replace(states, angle=np.ascontiguousarray(states.angle[:, ::-1]))
    goal, means = np.array([450.0, 560.0]), []
    for one, aim in ((states, goal), (exchanged, goal[::-1].copy())):
        begin, random = begin_parameters(one, DOMAIN, Shaping().weights), random_state(0)
        found = [np.abs(one.angle[draw_begin(begin, aim, 200.0, random)] - aim) for _ in range(4000)]
        means.append(np.mean(found, axis=0))
    np.testing.assert_allclose(means[0], means[1][::-1], rtol=0.05)


def test_nothing_near_the_goal_gives_the_nearest() -> None:
    begin = begin_parameters(_line(), DOMAIN, Shaping().weights)
    assert draw_begin(begin, np.array([1000.0]), 20.0, random_state(0)) == 799
    assert draw_begin(begin, np.array([20.0]), 20.0, random_state(0)) == 0


def test_infinite_deviation_draws_all_alike() -> None:
    begin, random = begin_parameters(_line(), DOMAIN), random_state(0)
    drawn = np.array([draw_begin(begin, np.array([500.0]), np.inf, random) for _ in range(20_000)])
    counts = np.bincount(drawn // 100, minlength=8)
    np.testing.assert_allclose(counts / len(drawn), 1 / 8, atol=0.012)


def test_states_are_sorted_scaled_windows_at_rest(simulation: Simulation, begin: BeginStates) -> None:
    assert len(begin) == 1500
    assert (np.diff(begin.angle[:, 0]) >= 0).all()
    rows = resting_rows()
    from_fit = transitions(rows, simulation.window).inputs[:, :16]
    in_order = from_fit[np.argsort(from_fit[:, 0], kind="stable")]
    expected = scaled_state(in_order, simulation.window, simulation.scaling)
    np.testing.assert_allclose(begin.states, expected, atol=1e-6)


def _moving(n: int = 30) -> Rows:
    """Return one sequence that began in motion: it moves, stands with closed valves, and moves again."""
    time = np.arange(n) / 30
    angle = np.concatenate([np.linspace(300, 500, 10), np.full(12, 500.0), np.linspace(500, 300, n - 22)])[:, None]
    command = np.zeros((n, 1, 2))
    command[:10] = 1.0
    command[24:] = -1.0
    flags = np.zeros(n, bool)
    return Rows(np.zeros(n, np.int64), np.arange(n) + 5, time, angle, np.full((n, 1, 2), 50.0), command, flags)


def test_standing_still_within_a_sequence(simulation: Simulation) -> None:
    found = begin_states(_moving(), simulation.window, simulation.scaling, simulation.spec)
    # Rows 9..22 have one angle, and the valves close after row 9; a state needs its three rows and one more for the
    # oldest velocity, with closed valves in between: 13..22.
    assert (found.angle == 500).all()
    assert len(found) == 10


@pytest.mark.parametrize("unit", [0.2, 1.0, 40.0])
def test_what_is_at_rest_is_so_whatever_a_count_is(simulation: Simulation, unit: float) -> None:
    """An arm whose readings differ by 0.09 degrees and 0.006 bar is at rest, by three times as much it is not."""
    spec = replace(
        simulation.spec,
        counts_per_degree=unit * simulation.spec.counts_per_degree,
        counts_per_bar=unit * simulation.spec.counts_per_bar,
    )
    rows, flicker = _moving(), (np.arange(30) % 2).astype(float)
    for angle, pressure, found in ((1.0, 1.0, 10), (max(3.0, 1.1 / unit), 0.0, 0), (0.0, max(3.0, 1.1 / unit), 0)):
        here = replace(
            rows,
            angle=unit * (rows.angle + angle * flicker[:, None]),
            pressure=unit * (rows.pressure + pressure * flicker[:, None, None]),
        )
        if found:
            assert len(begin_states(here, simulation.window, simulation.scaling, spec)) == found
        else:
            with pytest.raises(UnusableInput, match="at rest"):
                begin_states(here, simulation.window, simulation.scaling, spec)


def test_a_coarse_sensor_may_waver_by_a_count(simulation: Simulation) -> None:
    spec = replace(simulation.spec, counts_per_degree=1.0)
    rows = replace(_moving(), angle=np.round(_moving().angle / 10) + (np.arange(30) % 2)[:, None])
    assert len(begin_states(rows, simulation.window, simulation.scaling, spec)) >= 10


@pytest.mark.parametrize("change", ["creeping angle", "pressure", "open valve", "gap", "sequence"])
def test_what_is_not_at_rest(simulation: Simulation, change: str) -> None:
    rows = _moving()
    if change == "creeping angle":
        rows = replace(rows, angle=rows.angle + np.arange(30)[:, None])
    elif change == "pressure":
        rows = replace(rows, pressure=rows.pressure + 3 * (np.arange(30) % 2)[:, None, None])
    elif change == "open valve":
        rows = replace(rows, command=np.where(np.arange(30)[:, None, None] % 3 == 0, 1.0, 0.0))
    elif change == "gap":
        rows = replace(rows, step=2 * rows.step)
    else:
        rows = replace(rows, sequence=np.arange(30) // 3)
    with pytest.raises(UnusableInput, match="at rest"):
        begin_states(rows, simulation.window, simulation.scaling, simulation.spec)


def test_blocks_are_one_stream(simulation: Simulation, begin: BeginStates) -> None:
    blocks = [resting_rows(sequences=700, seed=seed) for seed in (1, 2)]
    together = begin_states(iter(blocks), simulation.window, simulation.scaling, simulation.spec)
    assert len(together) == 1400
    with pytest.raises(UnusableInput, match="at rest"):
        begin_states(iter([]), simulation.window, simulation.scaling, simulation.spec)
