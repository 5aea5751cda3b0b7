"""The monitor: what it finds, how soon, and that it leaves healthy arms alone."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from benchmarks.faults import KINDS, fitted, healthy_collecting, judged, play, watched_steps
from tests.late_arms import LateArm

from pneumarm.arm import Reading, open_arm
from pneumarm.arm.virtual import (
    DeadPotentiometer,
    Leak,
    StuckValve,
    SupplyLoss,
    SwappedValves,
    VirtualArm,
    WornPotentiometer,
    draw_parameters,
)
from pneumarm.checkup.leaks import LeakTest, leak_test, leaking
from pneumarm.control import Finding, Monitor
from pneumarm.control.monitor import marks_of
from pneumarm.control.monitor.hypotheses import DRAINS, hypotheses
from pneumarm.errors import ArmFailure, UnusableInput
from pneumarm.simulation.fit import FitSettings, fit_store
from pneumarm.transitions import WHOLE_PERIODS, Store, Window, collect, transitions


@pytest.fixture(scope="module")
def simulation(tmp_path_factory):
    arm = VirtualArm(draw_parameters(3), seed=3)
    with Store.for_arm(tmp_path_factory.mktemp("monitor") / "db", arm.spec) as store:
        collect(arm, store, 10_000, 3, settings=WHOLE_PERIODS)
        return fit_store(store, FitSettings(epochs=12)).simulation


@cache
def by_name():
    return {kind.name: kind for kind in KINDS}


@pytest.mark.parametrize(
    ("name", "within"),
    [
        ("inlet stuck closed", 4.0),
        ("inlet stuck open", 4.0),
        ("outlet stuck closed", 4.0),
        ("inlet and outlet swapped", 2.0),
        ("muscles swapped", 2.0),
        ("supply lost", 0.7),
        ("potentiometer dead", 0.07),
        ("potentiometer frozen", 0.6),
        ("torn hose (2 / s)", 15.0),  # a muscle that is empty loses nothing
    ],
)
def test_finds_faults_with_a_simulation(simulation, name, within):
    for seed in range(3):
        case = judged(play(by_name()[name], 3, seed), simulation)
        assert {case.kinds[0], case.details[0]} & set(by_name()[name].found_as)
        assert case.early == 0
        assert case.since_contradiction <= within + 1e-9
        assert case.unmarked <= 30


@pytest.mark.parametrize("name", ["potentiometer dead", "supply lost", "potentiometer worn", "noise"])
def test_says_nothing_else_of_an_arm_with_one_fault(simulation, name):
    """A wrong angle misleads whatever expects pressures, and few readings tell a lost supply from a stuck inlet."""
    kind = by_name()[name]
    for seed in (0, 1):
        assert set(judged(play(kind, 3, seed), simulation).kinds) <= set(kind.found_as)


def test_a_worn_potentiometer_is_told_with_the_angle(simulation):
    worn = WornPotentiometer(angle=10.0, width=4.0, height=25.0, contact=15.0)
    arm = VirtualArm(draw_parameters(3), seed=4, faults=[worn])
    monitor = Monitor(arm.spec, simulation)
    for _ in watched_steps(arm, monitor, 4):
        if any(one.kind == "worn-potentiometer" for one in monitor.findings) or arm.time > 200:
            break
    found = monitor.findings[-1]
    assert {one.kind for one in monitor.findings} <= {"worn-potentiometer", "sensor-noise"}
    assert (found.kind, found.spoils) == ("worn-potentiometer", False)
    assert abs(float(found.detail.split()[-2]) - 10.0) < 4.0


@pytest.mark.parametrize(
    "name",
    [
        "inlet stuck closed",
        "inlet stuck open",
        "outlet stuck closed",
        "muscles swapped",
        "supply lost",
        "potentiometer dead",
        "torn hose (2 / s)",
    ],
)
def test_finds_faults_before_there_is_a_simulation(name):
    for arm in (1, 2):
        case = judged(play(by_name()[name], arm, arm), None)
        assert {case.kinds[0], case.details[0]} & set(by_name()[name].found_as)
        assert case.early == 0
        assert case.since_contradiction <= 10.0


def test_leaves_healthy_arms_alone(simulation):
    arm = VirtualArm(draw_parameters(3), seed=8)
    monitor = Monitor(arm.spec, simulation)
    for _ in watched_steps(arm, monitor, 8):
        if arm.time > 600:
            break
    assert monitor.findings == []
    for seed in (4, 5, 6):
        arm = VirtualArm(draw_parameters(seed), seed=seed)
        monitor = Monitor(arm.spec)
        for _ in watched_steps(arm, monitor, seed):
            if arm.time > 300:
                break
        assert monitor.findings == []


PULSED = replace(WHOLE_PERIODS, pulses=0.7)


@pytest.mark.parametrize("late", [0.1, 0.2])
def test_valves_that_answer_late_are_no_fault_and_one_that_sticks_is(late):
    arm = LateArm(7, late, [StuckValve(muscle=1, begin=240.0)])
    monitor = Monitor(arm.spec)
    for step in watched_steps(arm, monitor, 7):
        if step.reading.time > 280:
            break
    assert {(one.kind, one.joint, one.muscle) for one in monitor.findings} == {("stuck-valve", 1, 1)}
    assert all(one.noticed > 240 for one in monitor.findings)


@pytest.fixture(scope="module")
def simulation_of_pulses(tmp_path_factory):
    arm = VirtualArm(draw_parameters(3), seed=3)
    with Store.for_arm(tmp_path_factory.mktemp("pulsed") / "db", arm.spec) as store:
        collect(arm, store, 10_000, 3, settings=PULSED)
        return fit_store(store, FitSettings(epochs=12)).simulation


@pytest.mark.parametrize("by_rules", [True, False])
def test_pulses_are_no_fault_and_faults_are_found_under_them(simulation_of_pulses, by_rules):
    arm = VirtualArm(draw_parameters(3), seed=7)
    monitor = Monitor(arm.spec, None if by_rules else simulation_of_pulses)
    for _ in watched_steps(arm, monitor, 8, PULSED):
        if arm.time > 300 and not arm.faults:
            assert monitor.findings == []
            arm.faults = (SwappedValves(muscle=2, begin=arm.time),)
        if monitor.findings or arm.time > 330:
            break
    (found,) = monitor.findings
    assert found.spoils
    if not by_rules:  # which tell less of what it is
        assert (found.kind, found.muscle) == ("swapped-valves", 2)


@pytest.mark.soak
def test_cries_wolf_at_most_once_in_ten_hours(tmp_path):
    arms = list(range(11, 21))
    watched = [healthy_collecting(arm, fitted(tmp_path, arm), 1.6) for arm in arms]
    print(watched)
    assert sum(hours for _, hours in watched) >= 10.0  # the arms are not watched on their way to begin states
    assert sum(one.spoils for found, _ in watched for one in found) <= 1


def test_a_fault_that_ends_is_over():
    arm = VirtualArm(draw_parameters(3), seed=2, faults=[SupplyLoss(begin=60.0, end=100.0)])
    monitor = Monitor(arm.spec)
    for _ in watched_steps(arm, monitor, 2):
        if arm.time > 160:
            break
    assert {one.kind for one in monitor.findings} == {"low-supply"}
    assert all(50.0 < one.since < 110.0 for one in monitor.findings)
    assert monitor.now == []


def watched_until(monitor, arm, end, seed):
    for _ in watched_steps(arm, monitor, seed):
        if arm.time > end:
            break


def test_what_it_has_seen_of_an_arm_for_long_counts_more_than_a_simulation(simulation):
    arm = VirtualArm(draw_parameters(3), seed=6)
    monitor = Monitor(arm.spec, simulation)
    watched_until(monitor, arm, 400.0, 6)
    assert monitor.findings == []
    arm.faults = (StuckValve(muscle=2, begin=arm.time),)
    for _ in watched_steps(arm, monitor, 7):
        if monitor.findings or arm.time > 430:
            break
    assert [(one.kind, one.muscle) for one in monitor.findings] == [("stuck-valve", 2)]
    assert "what this arm itself did" in monitor.reasons()


def test_what_was_seen_while_an_arm_was_recorded_is_known_later(simulation):
    arm = VirtualArm(draw_parameters(3), seed=6)
    recorded = Monitor(arm.spec)
    watched_until(recorded, arm, 400.0, 6)
    monitor = Monitor(arm.spec, simulation)
    monitor.know(recorded.get_state())
    begun = arm.time
    watched_until(monitor, arm, begun + 30.0, 7)
    assert monitor.findings == []
    assert "what this arm itself did" in monitor.reasons()
    for damaged in (b"", b"{}", b'{"identified": {"weight": ""}}'):
        with pytest.raises(UnusableInput, match="known of the arm"):
            monitor.know(damaged)
    with pytest.raises(UnusableInput, match="another arm"):
        Monitor(open_arm("virtual:joints=2").spec).know(recorded.get_state())
    with pytest.raises(UnusableInput, match="control period"):
        Monitor(replace(arm.spec, period=1 / 50)).know(recorded.get_state())


def test_a_simulation_judges_valves_while_little_was_seen_of_them(simulation):
    arm = VirtualArm(draw_parameters(3), seed=6)
    monitor = Monitor(arm.spec, simulation)
    monitor.begin(at_rest=True)
    for _ in range(9_000):  # five minutes of closed valves
        monitor.see(arm.read(), np.zeros((1, 2)))
        arm.wait(arm.spec.period)
    arm.faults = (SupplyLoss(begin=arm.time),)
    for _ in watched_steps(arm, monitor, 7):
        if monitor.findings:
            break
    assert monitor.findings[0].kind == "low-supply"
    assert "what the simulation of this arm expects" in monitor.reasons()


@pytest.mark.parametrize("begin", [18.0, 400.0])
def test_goes_on_from_its_state_as_if_nothing_had_happened(simulation, begin):
    faults = [StuckValve(begin=begin)]
    runs = []
    for interrupted in (False, True):
        arm = VirtualArm(draw_parameters(3), seed=2, faults=faults)
        monitor = Monitor(arm.spec, simulation)
        for step in watched_steps(arm, monitor, 2):
            if interrupted and begin - 3 < arm.time < begin + 7 and step.valves is None:
                state = monitor.get_state()
                monitor.findings = []
                monitor.set_state(state)
            if arm.time > begin + 22:
                break
        runs.append((monitor.findings, monitor.get_state()))
    assert runs[0] == runs[1]
    assert runs[0][0]
    with pytest.raises(UnusableInput, match="monitor"):
        Monitor(arm.spec).set_state(runs[0][1])


def test_an_arm_that_has_changed_is_not_complained_of_once_it_is_adapted_to(simulation):
    arm = VirtualArm(draw_parameters(3), seed=5)
    # An arm has changed if its angles are several times as far from the simulation's as this says of itself.
    changed = replace(simulation, error_std=simulation.error_std * [0.2, 1, 1, 1])
    monitor, adapted_at = Monitor(arm.spec, changed), 0.0
    for step in watched_steps(arm, monitor, 5):
        if arm.time > 90 and not adapted_at and step.valves is None:
            assert {one.kind for one in monitor.findings} == {"changed"}
            assert monitor.spoiled_since() is None
            found = len(monitor.findings)
            monitor.judge_by(simulation)
            monitor.judge_by(simulation)
            assert monitor.now == []
            adapted_at = arm.time
        if arm.time > 240:
            break
    assert adapted_at
    assert len(monitor.findings) == found
    arm.faults = (StuckValve(valve="outlet", begin=arm.time),)
    for _ in watched_steps(arm, monitor, 6):  # what the one before knew of faults is known still
        if arm.time > 300 or len(monitor.findings) > found:
            break
    assert (monitor.findings[found].kind, monitor.findings[found].muscle) == ("stuck-valve", 1)
    with pytest.raises(UnusableInput, match="adapted from"):
        Monitor(arm.spec).judge_by(simulation)


def see_angles(monitor, angles, begin=0):
    """Let ``monitor`` see closed valves, steady pressures and ``angles``, from the period ``begin`` on."""
    for k, angle in enumerate(angles, begin):
        monitor.see(Reading(k / 30, np.array([angle], float), np.full((1, 2), 50.0)), np.zeros((1, 2), np.int8))


@pytest.mark.parametrize("angles", [[600, 800, 1000], [50, 350, 650]])
def test_an_angle_that_is_swept_onto_a_rail_is_no_broken_wire(angles):
    swept, jumped = Monitor(VirtualArm().spec), Monitor(VirtualArm().spec)
    see_angles(swept, [*angles, 1023, 1023, 1023, 1023, 1023])
    assert swept.findings == []
    see_angles(jumped, [600, 610, 0, 0, 0])
    (found,) = jumped.findings
    assert (found.kind, found.since) == ("dead-potentiometer", pytest.approx(2 / 30))


def test_readings_that_jump_to_a_rail_and_back_are_no_broken_wire():
    monitor = Monitor(VirtualArm().spec)
    see_angles(monitor, [600, 610, 0, 0, 610, 0, 0, 620, 1023, 1023, 600])
    assert monitor.findings == []


def test_what_spoils_readings_is_told_while_it_lasts_by_a_monitor_that_stops():
    stops, warns = (Monitor(VirtualArm().spec, mode=mode) for mode in ("stop", "warn"))
    for monitor in (stops, warns):
        see_angles(monitor, [600, 610, 0, 0, 0, 0])
    since, what = stops.spoiled_since()
    assert (since, warns.spoiled_since()) == (pytest.approx(2 / 30), None)
    assert what.startswith("dead potentiometer: joint 1")
    see_angles(stops, [600, 605], begin=6)
    assert stops.spoiled_since() is None


def test_what_was_found_is_there_again_with_its_state():
    arm = VirtualArm()
    first, other = Monitor(arm.spec), Monitor(arm.spec)
    see_angles(first, [600, 610, 0, 0, 0, 0])
    other.set_state(first.get_state())
    assert other.findings == first.findings == first.now == other.now
    for monitor in (first, other):
        see_angles(monitor, [600, 605, 610], begin=6)
    (over,) = other.findings
    assert (over.kind, over.until) == ("dead-potentiometer", pytest.approx(6 / 30))
    assert other.findings == first.findings


def test_hypotheses_are_told_apart_for_any_number_of_joints():
    for joints in (1, 2, 3):
        names, readings = hypotheses(joints)
        muscles = 2 * joints
        assert len(names) == len(readings.source) == 3 + 8 * muscles + muscles * (muscles - 1) // 2
        kept = [np.concatenate([*map(np.ravel, parts)]).tobytes() for parts in zip(*readings, strict=True)]
        assert len(set(kept)) == len(names)


def test_what_is_found_has_one_name_also_where_two_hypotheses_share_it():
    """A hose that is off, and an outlet that is stuck open; then it is a torn one after all, and then not."""
    arm = VirtualArm(draw_parameters(3), seed=1)
    monitor = Monitor(arm.spec)
    monitor.see(arm.read(), np.zeros((1, 2), np.int8))
    names = [(one.kind, one.detail, one.muscle) for one in monitor._hypotheses]
    off = [h for h, name in enumerate(names) if name[1:] == (DRAINS, 1)]
    torn = names.index(("torn-hose", "it loses its air, as if its hose were torn", 1))
    assert len(off) == 2
    scored = [
        (18.0, 6.0, 0.0),
        (18.0, 6.0, 15.0),
        (18.0, 6.0, 21.0),
        (18.0, 6.0, 26.0),
        (26.0, 6.0, 23.0),
        (27.0, 6.0, 18.0),
    ]
    for now, scores in enumerate(scored):
        monitor._memory.score[[*off, torn]] = scores
        monitor._decide(float(now))
        (found,) = monitor.findings
        assert (found.kind, found.until) == ("torn-hose" if now in (3, 4) else "stuck-valve", None)


def test_marks_are_the_rows_from_since_to_until():
    time_, step = np.arange(10.0), np.array([0, 1, 2, 3, 5, 6, 7, 8, 9, 10])
    finding = Finding("stuck-valve", "stuck", 1, 1, since=2.5, noticed=4.0, until=5.0)
    (mark,) = marks_of([finding], time_, step)
    assert (mark.first, mark.last) == (3, 6)
    for kind in ("changed", "leak"):  # what is read then is what the arm is like
        assert marks_of([Finding(kind, "another arm", 1, None, since=0.0, noticed=1.0)], time_, step) == ()


def test_collecting_marks_what_a_fault_spoiled_and_nothing_is_learned_from_it(tmp_path):
    fault = SupplyLoss(begin=100.0, end=130.0)
    arm = VirtualArm(draw_parameters(3), seed=3, faults=[fault])
    watch = Monitor(arm.spec)
    with Store.for_arm(tmp_path / "db", arm.spec) as store:
        collect(arm, store, 4_000, 3, watch=watch, settings=WHOLE_PERIODS)
        store.check()
        marks = store.marks()
        assert marks
        kept = np.concatenate([transitions(rows, Window()).time for rows in store])
        everything = np.concatenate([rows.time for rows in store.blocks(marked=True)])
        assert store.transitions >= 4_000
    found = [one for one in watch.findings if one.kind == "low-supply"]
    assert found
    for one in found:
        assert not ((kept >= one.since) & (kept <= (one.until or np.inf))).any()
        assert ((everything >= one.since) & (everything <= (one.until or np.inf))).any()
    assert abs(found[0].since - 100.0) < 15.0


def test_collecting_gives_up_on_an_arm_that_stays_broken_and_says_why(tmp_path):
    arm = VirtualArm(draw_parameters(3), seed=3, faults=[DeadPotentiometer(begin=60.0), StuckValve(begin=60.0)])
    with (
        Store.for_arm(tmp_path / "db", arm.spec) as store,
        pytest.raises(ArmFailure, match="dead potentiometer"),
    ):
        collect(arm, store, 20_000, 3, watch=Monitor(arm.spec), settings=WHOLE_PERIODS)


def test_a_watched_collection_is_resumed_bit_for_bit(tmp_path):
    stores = []
    for name, parts in (("once", (4_000,)), ("twice", (2_000, 4_000))):
        for count in parts:
            arm = VirtualArm(draw_parameters(3), seed=3, faults=[SupplyLoss(begin=60.0, end=75.0)])
            with Store.for_arm(tmp_path / name, arm.spec) as store:
                collect(arm, store, count, 3, watch=Monitor(arm.spec), settings=WHOLE_PERIODS)
        with Store.open(tmp_path / name) as store:
            stores.append((store.marks(), np.concatenate([rows.angle for rows in store.blocks(marked=True)])))
    assert stores[0][0] == stores[1][0] != {}
    np.testing.assert_array_equal(stores[0][1], stores[1][1])


def test_a_leak_three_times_as_large_is_found_within_a_minute():
    for seed in (1, 2):
        arm = VirtualArm(draw_parameters(seed), seed=seed)
        arm.wait(300.0)
        healthy = leak_test(arm, LeakTest(watch=120.0))
        assert not leaking(healthy, leak_test(arm)).any()
        arm.faults = (Leak(muscle=2, factor=3, begin=arm.time),)
        now = leak_test(arm)
        assert now.seconds < 60
        assert leaking(healthy, now).tolist() == [[False, True]]


def test_a_tight_muscle_that_leaks_half_as_much_again_is_found_within_ten_minutes():
    """Arm 4 turns as it leaks, which changes its pressures more than the leak does."""
    test = LeakTest(watch=540.0)
    arm = VirtualArm(draw_parameters(4), seed=4)
    arm.wait(300.0)
    healthy = leak_test(arm, test)
    assert not leaking(healthy, leak_test(arm, test), test).any()
    arm.faults = (Leak(muscle=1, factor=1.5, begin=arm.time),)
    now = leak_test(arm, test)
    assert now.seconds < 600
    assert leaking(healthy, now, test).tolist() == [[True, False]]
    uncorrected = replace(test, compression=0.0)
    assert (leak_test(arm, uncorrected).rate[0, 0] - now.rate[0, 0]) > (now.rate - healthy.rate)[0, 0]


def test_what_the_sensors_say_of_an_empty_muscle_changes_nothing():
    arm = VirtualArm(seed=4)
    random, valves = np.random.default_rng(4), np.zeros((1, 2), np.int8)
    watches, scores = (Monitor(arm.spec), Monitor(arm.spec)), []
    for period in range(9_000):
        reading = arm.read()
        for watch, zero in zip(watches, (0.0, 200.0), strict=True):
            watch.see(replace(reading, pressure=reading.pressure + zero), valves)
        if period == 6_000:
            scores = [np.array(json.loads(watch.get_state())["memory"]["score"]) for watch in watches]
        broken = valves.copy()
        if period >= 6_000:
            broken[0, 0] = min(broken[0, 0], 0)
        arm.set_valves(broken)
        arm.wait(arm.spec.period)
        if period % 6 == 0:
            valves = random.integers(-1, 2, (1, 2)).astype(np.int8)
    assert max(score.max() for score in scores) < 0.5 * watches[0].settings.by_identification.alarm
    first, other = (watch.findings[0] for watch in watches)
    assert (first.kind, first.joint, first.muscle) == (other.kind, other.joint, other.muscle) == ("stuck-valve", 1, 1)
    assert abs(first.noticed - other.noticed) < 2.0
