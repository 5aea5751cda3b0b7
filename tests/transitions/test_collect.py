"""Collecting follows section 3.2.2, goes on where it was interrupted, and ends well when the arm does not."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from stand_ins import FirstOrderArm

from pneumarm.arm import ArmSpec, guarded, open_arm
from pneumarm.arm.valves import to_actions
from pneumarm.arm.virtual import VirtualArm, draw_parameters
from pneumarm.errors import ArmFailure, PneumarmError, UnusableInput
from pneumarm.transitions import WHOLE_PERIODS, CollectBegin, CollectSettings, Store, collect
from pneumarm.transitions.collect import End, end_of, random_actions
from pneumarm.transitions.rows import join_rows

SHORT = CollectSettings(
    actions=100, pulses=0.0, inlets=0.5, lean=0.0, begin=CollectBegin(deflate=0.5, inflate=0.5, settle=0.2)
)


def collected(folder, name="s.db", joints=1, count=2000, settings=SHORT, arm=None, **options):
    arm = arm or FirstOrderArm(joints)
    with Store.create(folder / name, arm.spec) as store:
        result = collect(arm, store, count, settings=settings, **options)
    return arm, result


def content(path):
    with Store.open(path) as store:
        rows = vars(join_rows(store))
        return rows | rows.pop("measured"), list(store.catalogue()), store.state()


def assert_same(one, other):
    for name, values in one[0].items():
        np.testing.assert_array_equal(values, other[0][name], err_msg=name)
    assert one[1:] == other[1:]


def test_sequences_are_those_of_the_thesis(tmp_path):
    arm = FirstOrderArm(max_pressure=9.0)
    _, result = collected(tmp_path, count=4000, settings=WHOLE_PERIODS, arm=arm)
    assert (result.transitions, result.sequences) == (4000, 20)
    rows, catalogue, _ = content(tmp_path / "s.db")
    assert len(rows["time"]) == 20 * 201
    assert rows["at_rest"].all()
    assert {entry.kind for entry in catalogue} == {"zero-velocity", "velocity"}
    assert result.seconds == pytest.approx(arm.time)
    assert not arm.closed
    # every sequence is preceded by venting for 2 s, inflating each muscle for up to 1.2 s, and 1 s of rest
    starts = [n for n, (_, valves) in enumerate(arm.log) if (valves == -1).all() and vented(arm.log, n)]
    assert len(starts) == 20
    lengths = []
    for start in starts:
        begin, _ = arm.log[start]
        inflation = arm.log[start + 1 : start + 4]
        assert inflation[0][0] - begin == pytest.approx(2.0)
        assert (inflation[0][1] == 1).all()
        assert (inflation[-1][1] == 0).all()
        assert arm.log[start + 4][0] - inflation[-1][0] == pytest.approx(1.0)
        lengths += [time - inflation[0][0] for time, _ in inflation[1:]]
    assert 0 < min(lengths) < 0.3
    assert 0.9 < max(lengths) <= 1.2 + 1e-9
    assert result.peak_pressure.shape == (1, 2)


def vented(log, n):
    return n + 1 < len(log) and log[n + 1][0] - log[n][0] > 1.9


def runs_of(actions):
    return [len(list(group)) for _, group in itertools.groupby(actions)]


def test_actions_are_uncorrelated_or_held(tmp_path):
    # a limit that is never reached, so that the actions applied are those drawn
    arm = FirstOrderArm(joints=2, max_pressure=9.0)
    collected(tmp_path, count=20_000, arm=arm)
    rows, catalogue, _ = content(tmp_path / "s.db")
    actions = to_actions(np.nan_to_num(rows["command"]))
    for joint in range(2):
        of_kind = {"zero-velocity": [], "velocity": []}
        for entry in catalogue:
            mine = actions[rows["sequence"] == entry.number][:-1, joint]
            of_kind[entry.kind].append(mine)
        free = np.concatenate(of_kind["zero-velocity"])
        shares = np.bincount(free, minlength=9) / len(free)
        np.testing.assert_allclose(shares, 1 / 9, atol=0.015)
        repeated = np.mean([np.mean(np.diff(one) == 0) for one in of_kind["zero-velocity"]])
        assert repeated == pytest.approx(1 / 9, abs=0.015)
        # held: on average 5.5 steps, and runs are longer still where the same action is drawn again
        held = [length for one in of_kind["velocity"] for length in runs_of(one)[:-1]]
        assert np.mean(held) == pytest.approx(5.5 * 9 / 8, rel=0.05)
        kinds = len(of_kind["velocity"]) / len(catalogue)
        assert 0.4 < kinds < 0.6
    assert (actions[:, 0] != actions[:, 1]).mean() == pytest.approx(8 / 9, abs=0.03)  # each joint by itself


def test_what_is_stored_is_what_the_guard_applied(tmp_path):
    arm, result = collected(tmp_path, arm=FirstOrderArm(max_pressure=0.4))  # 120 counts: reached all the time
    rows, _, _ = content(tmp_path / "s.db")
    over = rows["pressure"] > arm.spec.max_pressure_counts
    assert over.any()
    assert not (rows["command"][over] > 0).any()
    assert result.interventions.pressure > 100
    assert result.interventions.total == result.interventions.pressure
    assert (result.peak_pressure >= rows["pressure"].max(axis=0)).all()


@pytest.mark.parametrize("joints", [1, 2])
def test_a_resumed_collection_equals_an_uninterrupted_one(tmp_path, joints):
    _, through = collected(tmp_path, "through.db", joints, 3000)
    done = []

    def interrupt(total, wanted):
        done.append((total, wanted))
        if len(done) % 7 == 0:
            raise KeyboardInterrupt

    arm = FirstOrderArm(joints)
    Store.create(tmp_path / "parts.db", arm.spec).close()
    interruptions = 0
    while True:
        try:
            with Store.append_to(tmp_path / "parts.db") as store:
                result = collect(FirstOrderArm(joints), store, 3000, settings=SHORT, progress=interrupt)
                break
        except KeyboardInterrupt:
            interruptions += 1
    assert interruptions == 4
    assert done == [(100 * n, 3000) for n in range(1, 31)]
    assert_same(content(tmp_path / "through.db"), content(tmp_path / "parts.db"))
    np.testing.assert_array_equal(result.peak_pressure, through.peak_pressure)
    assert result.seconds == pytest.approx(through.seconds, rel=1e-12)
    assert (result.transitions, result.interventions) == (through.transitions, through.interventions)


def test_a_killed_collection_resumes_bit_for_bit(tmp_path, python):
    script = """
import os, signal, sys
from stand_ins import FirstOrderArm
from pneumarm.arm import BeginState
from pneumarm.transitions import CollectBegin, CollectSettings, Store, collect
from pathlib import Path
path, reads = Path(sys.argv[1]), int(sys.argv[2])
class Killed(FirstOrderArm):
    def read(self):
        if self.reads == reads:
            os.kill(os.getpid(), signal.SIGKILL)
        return super().read()
arm = Killed()
begin = CollectBegin(deflate=0.5, inflate=0.5, settle=0.2)
settings = CollectSettings(actions=100, pulses=0.0, inlets=0.5, lean=0.0, begin=begin)
with (Store.append_to(path) if path.exists() else Store.create(path, arm.spec)) as store:
    collect(arm, store, 2000, settings=settings)
"""
    collected(tmp_path, "through.db")
    for reads in (350, 1, 620, -1):
        done = python(script, tmp_path / "killed.db", reads)
        assert done.returncode == (-9 if reads > 0 else 0), done.stderr
    assert_same(content(tmp_path / "through.db"), content(tmp_path / "killed.db"))


def test_asking_for_more_goes_on_and_for_less_does_nothing(tmp_path):
    collected(tmp_path, "more.db", count=4000)
    arm, first = collected(tmp_path, "s.db", count=2000)
    with Store.append_to(tmp_path / "s.db") as store:
        time = arm.time
        again = collect(arm, store, 2000, settings=SHORT)
        assert arm.time == time
        assert again.transitions == first.transitions == 2000
        np.testing.assert_array_equal(again.peak_pressure, first.peak_pressure)
        collect(arm, store, 4000, settings=SHORT)
    assert_same(content(tmp_path / "more.db"), content(tmp_path / "s.db"))


def test_the_last_sequence_is_cut_short_where_no_more_are_asked_for(tmp_path):
    _, result = collected(tmp_path, count=2050, exact=True)
    assert (result.transitions, result.sequences) == (2050, 21)
    collected(tmp_path, "whole.db", count=2100)
    cut, whole = content(tmp_path / "s.db"), content(tmp_path / "whole.db")
    assert [entry.transitions for entry in cut[1]] == [*[100] * 20, 50]
    for name, values in cut[0].items():  # but for where it ends it is the same
        np.testing.assert_array_equal(values[:-1], whole[0][name][: len(values) - 1], err_msg=name)
    with Store.append_to(tmp_path / "s.db") as store:
        assert collect(FirstOrderArm(), store, 2051, settings=SHORT, exact=True).transitions == 2051
        assert collect(FirstOrderArm(), store, 2052, settings=SHORT).transitions == 2151
        store.check()


def test_what_a_lost_period_cost_is_made_up_for(tmp_path):
    _, result = collected(tmp_path, arm=FirstOrderArm(late=60), exact=True)
    assert result.missed_deadlines == 3
    assert (result.transitions, result.sequences) == (2000, 21)


def test_seeds_make_the_difference(tmp_path):
    collected(tmp_path, "0.db", seed=0)
    collected(tmp_path, "1.db", seed=1)
    assert not np.array_equal(content(tmp_path / "0.db")[0]["command"], content(tmp_path / "1.db")[0]["command"])


def test_a_store_goes_on_when_the_links_have_been_measured(tmp_path):
    collected(tmp_path)
    arm = FirstOrderArm()
    arm.spec = replace(arm.spec, links=(0.21,))
    with Store.append_to(tmp_path / "s.db") as store:
        assert collect(arm, store, 4000, settings=SHORT).transitions == 4000


def test_other_settings_or_another_arm_are_refused_before_anything_moves(tmp_path):
    collected(tmp_path)
    arm = FirstOrderArm()
    with Store.append_to(tmp_path / "s.db") as store:
        with pytest.raises(UnusableInput, match="seed was 0, is 1"):
            collect(arm, store, 4000, seed=1, settings=SHORT)
        with pytest.raises(UnusableInput, match="actions was 100, is 200"):
            collect(arm, store, 4000)
        with pytest.raises(UnusableInput, match=r"made for another arm \(period was"):
            collect(FirstOrderArm(period=0.02), store, 4000, settings=SHORT)
        with pytest.raises(UnusableInput, match="joints was 1, is 2"):
            collect(FirstOrderArm(2), store, 4000, settings=SHORT)
        with pytest.raises(UnusableInput, match="999 transitions are too few"):
            collect(arm, store, 999, settings=SHORT)
    imported = Store.create(tmp_path / "imported.db", arm.spec, valves=False)
    with imported, pytest.raises(UnusableInput, match="continuous commands"):
        collect(arm, imported, 2000)
    assert arm.reads == 0
    with pytest.raises(UnusableInput, match="longest_hold cannot be 0"):
        CollectSettings(longest_hold=0)
    with pytest.raises(UnusableInput, match=r"inflate cannot be -1.0; expected a number, 0 or more"):
        CollectBegin(inflate=-1.0)


def test_an_arm_that_fails_keeps_what_was_acknowledged_and_is_closed(tmp_path):
    arm = FirstOrderArm(fail_after=500)
    with Store.create(tmp_path / "s.db", arm.spec) as store:
        with pytest.raises(
            ArmFailure, match=r"FirstOrderArm\.\w+ failed: OSError: no answer from the board"
        ) as failure:
            collect(arm, store, 2000, settings=SHORT)
        assert failure.value.exit_code == 1
        assert arm.closed
        assert store.sequences == 4
        store.check()
        result = collect(FirstOrderArm(), store, 2000, settings=SHORT)
        assert result.transitions == 2000
    collected(tmp_path, "through.db")
    assert_same(content(tmp_path / "through.db"), content(tmp_path / "s.db"))


def test_an_arm_that_talks_nonsense_is_a_failing_arm(tmp_path):
    class Nonsense(FirstOrderArm):
        def read(self):
            reading = super().read()
            if self.reads > 50:
                reading.angle[:] = np.nan
            return reading

    arm = Nonsense()
    with Store.create(tmp_path / "s.db", arm.spec) as store:
        with pytest.raises(ArmFailure, match="finite numbers"):
            collect(arm, store, 2000, settings=SHORT)
        assert arm.closed
        assert store.sequences == 0


def test_a_missed_deadline_is_counted_and_leaves_a_gap(tmp_path):
    _, result = collected(tmp_path, arm=FirstOrderArm(late=60))
    rows, _, _ = content(tmp_path / "s.db")
    assert result.missed_deadlines == 3
    assert result.transitions == 2099  # one too few in the first 20 sequences, so one more was collected
    gaps = np.flatnonzero((np.diff(rows["step"]) > 1) & (np.diff(rows["sequence"]) == 0))
    assert len(gaps) == 1
    assert rows["step"][gaps[0] + 1] - rows["step"][gaps[0]] == 4  # 1/30 s and 0.1 s


class Towards:
    """Pulls towards the goal, muscle against muscle."""

    def __init__(self):
        self.goals = []

    def reset(self, goal):
        self.goals.append(goal)

    def act(self, reading):
        sign = np.sign(self.goals[-1] - reading.angle).astype(np.int8)
        return np.stack([sign, -sign], axis=1)


def test_any_controller_can_collect(tmp_path):
    controller = Towards()
    goals = [[300.0, 400.0], [600.0, 700.0]]
    collected(tmp_path, joints=2, controller=controller, goals=goals)
    rows, catalogue, _ = content(tmp_path / "s.db")
    assert [entry.info["goal"] for entry in catalogue] == [goal.tolist() for goal in controller.goals]
    assert all(entry.kind == "controller" for entry in catalogue)
    drawn = np.array(controller.goals)
    assert ((drawn >= [300, 600]) & (drawn <= [400, 700])).all()
    ends = np.append(np.diff(rows["sequence"]) != 0, True)
    assert np.abs(rows["angle"][ends] - drawn).mean() < 60
    with Store.append_to(tmp_path / "s.db") as store, pytest.raises(UnusableInput, match="controller was 'Towards'"):
        collect(FirstOrderArm(2), store, 4000, settings=SHORT)


def test_a_controller_that_fails_is_told_apart_from_the_arm(tmp_path):
    class Broken(Towards):
        def act(self, reading):
            raise ZeroDivisionError("division by zero")

    arm = FirstOrderArm()
    store = Store.create(tmp_path / "s.db", arm.spec)
    told = pytest.raises(PneumarmError, match=r"31 decisions in a row .*raised: ZeroDivisionError")
    with store, told as failure:
        collect(arm, store, 2000, settings=SHORT, controller=Broken())
    assert not isinstance(failure.value, ArmFailure)
    assert arm.closed


def test_goals_are_drawn_from_the_sensors_range_by_default(tmp_path):
    controller = Towards()
    collected(tmp_path, count=10_000, controller=controller)
    goals = np.array(controller.goals)
    low, high = ArmSpec().angle_range
    assert goals.min() < low + 0.1 * (high - low)
    assert goals.max() > high - 0.1 * (high - low)


def ends_alone(arm):
    """Return the angles (2,) [counts] at which the first joint rests where one muscle alone is full."""
    found, moved = [], guarded(arm)
    moved.make_ready()
    for valves in ([[-1, 1]], [[1, -1]]):
        moved.set_valves(np.array(valves))
        moved.wait(8.0)
        moved.set_valves(np.zeros((1, 2)))
        moved.wait(1.0)
        found.append(moved.read().angle[0])
    return np.array(found)


@pytest.mark.parametrize("name", ["virtual:seed=3", "virtual:wide,seed=33", "virtual:wide,seed=12"])
def test_fast_arms_and_slow_ones_are_seen_wherever_they_can_be(tmp_path, name):
    """Arm 33 takes 3.4 s to fill, arm 12 takes 2.6 s, arm 3 less than one."""
    with open_arm(name) as arm, Store.create(tmp_path / "db", arm.spec) as store:
        collect(arm, store, 4000, settings=CollectSettings(ends=0.25))
        low, high = ends_alone(arm)
        first, last = store.percentiles()[0]
    assert first < low + 0.06 * (high - low)
    assert last > high - 0.06 * (high - low)


def test_sequences_from_an_end_come_at_equal_distances_and_take_all_ends_in_turn():
    made = [end_of(number, 0.25, 2) for number in range(32)]
    assert [number for number, end in enumerate(made) if end] == list(range(0, 32, 4))
    assert len({(*end.sides.tolist(), end.stays) for end in made if end}) == 8
    assert not any(end_of(number, 0.0, 1) for number in range(100))
    assert all(end_of(number, 1.0, 1) for number in range(100))


def test_muscles_lean_to_the_end_that_a_sequence_goes_to():
    settings, spec = CollectSettings(inlets=0.5, actions=2000), ArmSpec(pulses=False)
    for stays, side in ((True, 1), (False, -1)):
        end = End(np.array([1]), stays)
        _, made = random_actions(spec, settings, np.random.default_rng(0), end)
        mean = np.array(made.commands).mean(axis=0)
        assert (side * mean[0] > [0.2, -0.7]).all()
        assert (side * mean[0] < [0.7, -0.2]).all()


@pytest.mark.parametrize("joints", [1, 2])
def test_a_share_of_the_sequences_has_pulses_and_the_others_are_as_without(joints):
    spec, settings, kinds = ArmSpec(joints=joints), CollectSettings(pulses=0.5), []
    shortest = spec.shortest_pulse / spec.period
    for seed in range(200):
        kind, with_pulses = random_actions(spec, settings, np.random.default_rng(seed))
        _, without = random_actions(replace(spec, pulses=False), settings, np.random.default_rng(seed))
        commands = np.array(with_pulses.commands)
        kinds.append(kind)
        if kind in ("pulses", "sparse"):
            opened = np.abs(commands[commands != 0])
            assert opened.min() >= shortest * (1 - 1e-9)
            assert opened.max() <= 1
            assert len(np.unique(opened)) > 20
        else:
            np.testing.assert_array_equal(commands, without.commands)
    share = np.mean([kind in ("pulses", "sparse") for kind in kinds])
    assert share == pytest.approx(0.5, abs=0.12)
    assert set(kinds) == {"velocity", "zero-velocity", "pulses", "sparse"}


def test_pulses_are_stored_as_applied(tmp_path):
    arm = VirtualArm(draw_parameters(3), seed=1)
    with Store.create(tmp_path / "pulses.db", arm.spec) as store:
        collect(arm, store, 2000, settings=CollectSettings(pulses=0.5))
        command = np.concatenate([rows.command for rows in store])
    command = command[np.isfinite(command)]
    assert 0.02 < ((command % 1) != 0).mean() < 0.7
    shortest = arm.spec.shortest_pulse / arm.spec.period
    assert np.abs(command[command != 0]).min() >= shortest
