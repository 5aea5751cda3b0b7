"""Transfer: resumable, comparable, and the adapted agent is what was averaged."""

import itertools
import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

import pneumarm
from pneumarm.adaptation import Adaptation, AdaptationSettings, RefitSettings
from pneumarm.arm import Reading, open_arm
from pneumarm.arm.virtual import StuckValve, VirtualArm
from pneumarm.control import Monitor, TransferSettings, put_back, read_history, transfer, transfer_into
from pneumarm.errors import ArmFailure, UnusableInput
from pneumarm.learning import Agent, AnyAgent, PolicyAgent, PolicySettings, train
from pneumarm.learning.servo import ServoAgent, ServoSettings
from pneumarm.learning.servo.settings import SOFT, STIFF
from pneumarm.simulation import Simulation
from pneumarm.task import begin_states
from pneumarm.transitions import KINDS, Store, collect

SHORT = TransferSettings(episodes=12, test_episodes=6)


@pytest.fixture
def agent(small_run: Path) -> Agent:
    return Agent.load(small_run / "agent.safetensors")


class Interrupted(VirtualArm):
    """A virtual arm that fails at a certain reading."""

    left = 10**9

    def read(self) -> Reading:
        self.left -= 1
        if self.left < 0:
            raise OSError("cable")
        return super().read()


def test_a_transfer_that_failed_goes_on_as_if_nothing_had_happened(agent: Agent, tmp_path: Path) -> None:
    (tmp_path / "whole").mkdir()
    whole = transfer_into(tmp_path / "whole", agent, VirtualArm(seed=3), SHORT, seed=1)
    folder = tmp_path / "broken"
    for left in (150, 400):
        arm = Interrupted(seed=3)
        arm.left = left
        with pytest.raises(ArmFailure, match="OSError: cable"):
            transfer_into(folder, agent, arm, SHORT, seed=1)
    assert transfer_into(folder, agent, Interrupted(seed=3), SHORT, seed=1) == whole
    for name in ("episodes.csv", "adapted.safetensors"):
        assert (folder / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


class Clumsy(Agent):
    """An agent that fails to decide now and then, and keeps account of that."""

    failures: ClassVar[list[int]] = []

    def actor(self) -> Any:
        return self._clumsy(super().actor())

    def learner(self, learning_rate: float, seed: int = 0) -> Any:
        return self._clumsy(super().learner(learning_rate, seed))

    def _clumsy(self, actor: Any) -> Any:
        turns, act = itertools.count(), actor.act

        def acting() -> NDArray[np.int64]:
            if next(turns) % 20 == 19:
                self.failures.append(1)
                raise RuntimeError("no idea")
            return act()

        actor.act = acting  # type: ignore[method-assign]
        return actor


def test_what_the_guard_did_is_told_by_phase_and_known_after_an_interruption(agent: Agent, tmp_path: Path) -> None:
    clumsy = Clumsy(**vars(agent))
    (tmp_path / "whole").mkdir()
    whole = transfer_into(tmp_path / "whole", clumsy, VirtualArm(seed=3), SHORT, seed=1)
    replaced = {phase: counts["interventions"]["raised"] for phase, counts in whole["counts"].items()}
    assert list(replaced) == ["before", "learning", "after"]
    assert min(replaced.values()) > 0
    assert sum(replaced.values()) == len(Clumsy.failures)
    arm = Interrupted(seed=3)
    arm.left = 300
    with pytest.raises(ArmFailure, match="OSError: cable"):
        transfer_into(tmp_path / "broken", clumsy, arm, SHORT, seed=1)
    again = transfer_into(tmp_path / "broken", clumsy, VirtualArm(seed=3), SHORT, seed=1)
    assert all(counts["interventions"]["raised"] > 0 for counts in again["counts"].values())
    assert transfer_into(tmp_path / "broken", clumsy, VirtualArm(seed=3), SHORT, seed=1) == again


@pytest.fixture(scope="module")
def policy(small_run: Path) -> AnyAgent:
    settings = PolicySettings(
        agents=1, updates=10, arms=32, steps=16, hidden=(8,), validation_episodes=50, lookahead=8
    )
    simulation = Simulation.load(small_run / "simulation.safetensors")
    with Store.open(small_run / "transitions.db") as store:
        begin = begin_states(store.blocks(kinds=KINDS), simulation.window, simulation.scaling, simulation.spec)
    return train(simulation, begin, settings).agent


POLICY = TransferSettings(
    episodes=12,
    test_episodes=30,
    adaptation=AdaptationSettings(every=4, updates=2, warm_up=1, refit=RefitSettings(gain=0.0, certainty=0.0)),
)


def test_a_policy_that_was_interrupted_while_adapting_goes_on_as_if_nothing_had_happened(
    policy: AnyAgent, tmp_path: Path
) -> None:
    (tmp_path / "whole").mkdir()
    whole = transfer_into(tmp_path / "whole", policy, VirtualArm(seed=4), POLICY, seed=1)
    assert whole["adaptations"] > 0
    folder, readings = tmp_path / "broken", 0
    for _ in range(50):
        arm = Interrupted(seed=4)
        arm.left = 400 + readings
        readings += 150
        try:
            result = transfer_into(folder, policy, arm, POLICY, seed=1)
            break
        except ArmFailure:
            continue
    assert readings > 300  # it was interrupted
    assert result == whole
    versions = [f"agents/{number:03d}.safetensors" for number in range(whole["adaptations"] + 1)]
    assert sorted(path.name for path in (folder / "agents").iterdir()) == [Path(name).name for name in versions]
    for name in ("episodes.csv", "adapted.safetensors", "adaptation.json", *versions):
        assert (folder / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    assert _watch_of(folder) == _watch_of(tmp_path / "whole")
    assert (folder / "adapted.safetensors").read_bytes() != _saved(policy, tmp_path)
    assert (folder / "agents/000.safetensors").read_bytes() == _saved(policy, tmp_path)
    assert transfer_into(folder, policy, VirtualArm(seed=4), POLICY, seed=1) == whole  # there is nothing left to do


def test_the_monitor_knows_what_was_seen_while_the_arm_was_recorded(policy: AnyAgent, tmp_path: Path) -> None:
    arm, settings = VirtualArm(seed=4), TransferSettings(episodes=2, test_episodes=2)
    with Store.for_arm(tmp_path / "transitions.db", arm.spec) as store:
        collect(arm, store, 9_000, 1, watch=Monitor(arm.spec))
        watch = Monitor(arm.spec, policy.simulation)
        transfer(policy, arm, store, settings, seed=1, watch=watch)
    assert "what this arm itself did" in watch.reasons()


@pytest.fixture(scope="module")
def servo(small_run: Path) -> AnyAgent:
    """An agent that has learned too little to settle everywhere."""
    simulation = Simulation.load(small_run / "simulation.safetensors")
    with Store.open(small_run / "transitions.db") as store:
        begin = begin_states(store.blocks(kinds=KINDS), simulation.window, simulation.scaling, simulation.spec)
    settings = ServoSettings(agents=1, updates=60, arms=32, hidden=(16,), validation_movements=32)
    return train(simulation, begin, settings).agent


@pytest.mark.parametrize("thorough", [True, False])
def test_who_does_not_settle_learns_on_from_the_recording_and_its_movements(
    servo: AnyAgent, tmp_path: Path, thorough: bool
) -> None:
    never = RefitSettings(gain=0.99)  # by movements alone
    adaptation = AdaptationSettings(first=4, unsettled=0.0 if thorough else 1.0, thorough_updates=30, refit=never)
    settings = TransferSettings(episodes=12, test_episodes=8, hold=1.0, adaptation=adaptation)
    arm = VirtualArm(seed=4)
    with Store.for_arm(tmp_path / "transitions.db", arm.spec) as store:
        collect(arm, store, 2500, 1)
        moved = transfer(servo, arm, store, settings, seed=1)
    assert moved.adapted is not None
    made = [event for event in moved.adapted.events if event.what == "accepted"]
    assert bool(made) == thorough
    assert isinstance(servo, ServoAgent)
    assert isinstance(moved.agent, ServoAgent)
    assert (moved.agent.policy != servo.policy).any() == (moved.adapted.version > 0)
    assert len(moved.agent.settings.ways) == 4  # goes with the agent to who moves the arm next
    for event in made:
        assert (np.array(event.figures["after"]) < np.array(event.figures["before"])).mean() > 0.5


def test_of_versions_that_learned_thoroughly_the_better_ones_stay(servo: AnyAgent, small_run: Path) -> None:
    assert isinstance(servo, ServoAgent)
    with Store.open(small_run / "transitions.db") as store:
        rows = next(iter(store.blocks(kinds=KINDS)))
        first = rows.where(rows.sequence < np.unique(rows.sequence)[8])
        for worse in (False, True):
            adapting = Adaptation(servo, AdaptationSettings(first=4, thorough_updates=3), seed=1)
            for worth in np.linspace(-2.0, -1.0, 8):
                adapting.observe(first, float(worth), settled=False)
            assert adapting.learn(first, store)
            for number, worth in enumerate(np.linspace(-3.0, -1.5, 6) if worse else np.linspace(-1.5, -0.5, 6)):
                adapting.prefer()
                assert (adapting.version, number) == (1, number)  # too early to tell
                adapting.observe(first, float(worth), settled=False)
            again = Adaptation(servo, AdaptationSettings(first=4, thorough_updates=3), seed=1)
            again.set_state(adapting.get_state())
            for one in adapting, again:
                one.prefer()
                assert one.version == (0 if worse else 1)
                assert isinstance(one.agent, ServoAgent)
                assert one.agent.settings.stiffness == (SOFT if worse else STIFF)  # it was made anew
                assert (one.agent.policy != servo.policy).any() != worse
                assert (one.events[-1].what == "rolled back") == worse


def test_who_settles_holds_each_goal_and_adapts_to_all_of_that(servo: AnyAgent, tmp_path: Path) -> None:
    for hold, folder in ((1.5, tmp_path / "held"), (0.0, tmp_path / "ended")):
        settings = TransferSettings(episodes=9, test_episodes=2, hold=hold, adaptation=POLICY.adaptation)
        transfer_into(folder, servo, VirtualArm(seed=4), settings, seed=1)
        with Store.open(folder / "transitions.db") as store:
            lasted = [
                np.ptp(rows.time[rows.sequence == n]) for rows in store.blocks() for n in np.unique(rows.sequence)
            ]
        assert len(lasted) == 13
        if hold:
            assert min(lasted) > hold - 0.05
            assert np.median(lasted) == pytest.approx(hold, abs=0.05)  # one that comes late goes on for longer
        else:
            assert min(lasted) < 1.4


@pytest.mark.parametrize(("episodes", "learns"), [(8, False), (13, False), (14, True)])
def test_who_settles_makes_no_version_that_its_arm_could_not_try(
    servo: AnyAgent, episodes: int, learns: bool, tmp_path: Path
) -> None:
    """It is due after ten movements, two of a test among them."""
    adaptation = AdaptationSettings(first=10, updates=1)
    settings = TransferSettings(episodes=episodes, test_episodes=2, hold=0.5, adaptation=adaptation)
    transfer_into(tmp_path / "moved", servo, VirtualArm(seed=4), settings, seed=1)
    events = {event.what for event in read_history(tmp_path / "moved").events}
    assert bool(events & {"accepted", "refused"}) == learns


def _watch_of(folder: Path) -> bytes | None:
    with Store.open(folder / "transitions.db") as store:
        return store.state("watch")


@pytest.fixture(scope="module")
def moved(policy: AnyAgent, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a transfer in which the agent became at least one other version."""
    folder = tmp_path_factory.mktemp("transfers") / "moved"
    result = transfer_into(folder, policy, VirtualArm(seed=4), POLICY, seed=1)
    assert result["version"] == result["adaptations"] > 0
    return folder


def test_the_history_tells_every_movement_and_every_version(moved: Path) -> None:
    history = read_history(moved)
    total = 2 * POLICY.test_episodes + POLICY.episodes
    assert history.squares.shape == (total, 2, 3)
    assert (history.squares >= 0).all()  # a short movement can be predicted exactly
    assert (history.squares > 0).mean() > 0.9
    made = [event for event in history.events if event.what == "accepted"]
    assert [event.version for event in made] == list(range(1, history.version + 1))
    first = made[0].movement
    np.testing.assert_array_equal(history.squares[:first, 0], history.squares[:first, 1])
    assert not np.array_equal(history.squares[first:, 0], history.squares[first:, 1])
    assert any(f"version {history.version}" in sentence for sentence in history.sentences)


def test_any_version_can_be_put_back(moved: Path, policy: AnyAgent, tmp_path: Path) -> None:
    folder = tmp_path / "copy"
    shutil.copytree(moved, folder)
    newest = (folder / "adapted.safetensors").read_bytes()
    assert newest == (folder / f"agents/{read_history(folder).version:03d}.safetensors").read_bytes()
    assert put_back(folder, 0).version == 0
    assert (folder / "adapted.safetensors").read_bytes() == _saved(policy, tmp_path)
    assert read_history(folder).version == 0
    put_back(folder, 1)
    assert read_history(folder).put_back_by_hand == (0, 1)
    assert (folder / "adapted.safetensors").read_bytes() == (folder / "agents/001.safetensors").read_bytes()
    with pytest.raises(UnusableInput, match="no version 99; there are 0, 1"):
        put_back(folder, 99)
    with pytest.raises(UnusableInput, match=r"adaptation\.json: expected the history .* cannot be read"):
        put_back(tmp_path, 0)
    (folder / "adaptation.json").write_text("{}")
    with pytest.raises(UnusableInput, match="expected the history"):
        read_history(folder)


def test_an_agent_with_another_simulation_is_another_agent(moved: Path, policy: AnyAgent, tmp_path: Path) -> None:
    folder = tmp_path / "copy"
    shutil.copytree(moved, folder)
    assert isinstance(policy, PolicyAgent)
    other = replace(policy, simulation=replace(policy.simulation, error_std=2 * policy.simulation.error_std))
    with pytest.raises(UnusableInput, match="agent was"):
        transfer_into(folder, other, VirtualArm(seed=4), POLICY, seed=1)


def test_a_version_that_is_taken_back_moves_the_arm_no_more(
    policy: AnyAgent, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Whatever was earned: this is about what happens after the verdict, which tests of its own are about.
    monkeypatch.setattr(
        "pneumarm.adaptation.adaptation.verdict", lambda old, new, settings: "worse" if len(new) == 3 else "open"
    )
    settings = replace(POLICY, episodes=16, test_episodes=10, adaptation=replace(POLICY.adaptation, growth=3.0))
    result = transfer_into(tmp_path / "t", policy, VirtualArm(seed=4), settings, seed=1)
    assert result["rolled_back"]
    history = read_history(tmp_path / "t")
    back = next(event for event in history.events if event.what == "rolled back")
    at = back.movement
    np.testing.assert_array_equal(
        *np.moveaxis(history.squares[at : at + 2], 1, 0)
    )  # the one that arrived moves again
    assert (tmp_path / "t" / "agents" / f"{back.figures['taken_back']:03d}.safetensors").exists()


def _saved(agent: AnyAgent, folder: Path) -> bytes:
    agent.save(folder / "agent")
    return (folder / "agent").read_bytes()


@pytest.mark.parametrize(
    "settings",
    [replace(POLICY, learning_rate=0.0), replace(POLICY, adaptation=AdaptationSettings(every=0))],
)
def test_a_policy_that_is_not_to_adapt_stays_as_it_is(
    policy: AnyAgent, tmp_path: Path, settings: TransferSettings
) -> None:
    result = transfer_into(tmp_path / "t", policy, VirtualArm(seed=4), replace(settings, test_episodes=40), seed=1)
    assert result["adaptations"] == 0
    assert (tmp_path / "t" / "adapted.safetensors").read_bytes() == _saved(policy, tmp_path)


def test_learning_changes_the_agent_and_not_learning_does_not(agent: Agent, tmp_path: Path) -> None:
    def adapted(rate: float) -> Agent:
        settings = TransferSettings(episodes=6, test_episodes=1, learning_rate=rate)
        transfer_into(tmp_path / f"rate {rate}", agent, VirtualArm(seed=3), settings)
        return Agent.load(tmp_path / f"rate {rate}" / "adapted.safetensors")

    assert np.array_equal(adapted(0.0).weights(), agent.weights())
    assert not np.array_equal(adapted(0.05).weights(), agent.weights())


def test_other_settings_need_another_folder(agent: Agent, tmp_path: Path) -> None:
    transfer_into(tmp_path / "t", agent, VirtualArm(), TransferSettings(episodes=0, test_episodes=1))
    with pytest.raises(UnusableInput, match="other settings"):
        transfer_into(tmp_path / "t", agent, VirtualArm(), TransferSettings(episodes=5, test_episodes=1))


def test_the_mean_is_taken_over_the_share_that_was_asked_for(agent: Agent, tmp_path: Path) -> None:
    made = []
    for averaged in (0.0, 0.5, 1.0):
        with Store.create(tmp_path / f"{averaged}.db", agent.spec) as store:
            settings = TransferSettings(episodes=4, test_episodes=1, averaged=averaged)
            moved = transfer(agent, VirtualArm(seed=3), store, settings)
            made.append(moved.agent.weights())
            seen = np.frombuffer((store.state("mean") or b"")[:8], np.int64)[0]
            assert seen == round(4 * averaged)
    assert not np.array_equal(made[0], made[1])
    assert not np.array_equal(made[1], made[2])


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"episodes": -1}, "episodes cannot be -1; expected a whole number, 0 or more"),
        ({"test_episodes": 0}, "test_episodes cannot be 0; expected a whole number, 1 or more"),
        ({"learning_rate": 2.0}, "learning_rate cannot be"),
        ({"averaged": 1.5}, "averaged"),
    ],
)
def test_impossible_settings_are_refused(settings: dict[str, float], words: str) -> None:
    with pytest.raises(UnusableInput, match=words):
        TransferSettings(**settings)  # type: ignore[arg-type]


def test_a_loaded_controller_needs_readings_only(small_run: Path) -> None:
    controller = pneumarm.load_controller(small_run / "agent.safetensors")
    with pytest.raises(UnusableInput, match=r"reset\(goal\)"):
        controller.act(Reading(0.0, np.array([500.0]), np.zeros((1, 2))))
    with pytest.raises(UnusableInput, match="1 finite angle"):
        controller.reset(np.array([np.nan]))
    with open_arm("virtual:seed=3") as arm:
        controller.reset(np.array([650.0]))
        for _ in range(20):
            valves = controller.act(arm.read())
            assert valves.shape == (1, 2)
            assert set(np.unique(valves)) <= {-1, 0, 1}
            arm.set_valves(valves)
            arm.wait(arm.spec.period)
        reading = arm.read()
        assert np.array_equal(controller.act(reading), controller.act(reading))


def test_the_episodes_file_tells_the_time_on_the_arm(small_run: Path) -> None:
    results = json.loads((small_run / "results.json").read_text())
    before = results["transfer"]["before"]
    assert 20 * 3 < before["seconds"] < 20 * 12
    assert before["intervals"]["success_rate"][0] <= before["success_rate"] <= before["intervals"]["success_rate"][1]


WATCHED = TransferSettings(episodes=6, test_episodes=6, learning_rate=0.0)


def broken_valve(end: float | None = None) -> VirtualArm:
    return VirtualArm(seed=4, faults=[StuckValve(position="open", begin=20.0, end=end)])


def test_a_transfer_gives_up_on_an_arm_that_stays_broken_and_goes_on_once_it_is_told_to(
    policy: AnyAgent, tmp_path: Path
) -> None:
    """What is right for collecting is right here."""
    folder = tmp_path / "t"
    with pytest.raises(ArmFailure, match=r"stuck valve.*for [5-9] movements now.*--monitor warn"):
        transfer_into(folder, policy, broken_valve(), WATCHED, seed=1)
    with Store.open(folder / "transitions.db") as store:
        made, marked = store.sequences, sum(store.marked_rows(1).values())
    assert 5 <= made < 18
    assert marked > 0  # the movements that it gave up for are stored
    result = transfer_into(folder, policy, broken_valve(), WATCHED, seed=1, monitor="warn")
    assert [result[phase]["episodes"] for phase in ("before", "after")] == [6, 6]
    assert any(one["kind"] == "stuck-valve" for one in result["findings"])
    assert sum(result["marked"].values()) == marked


def test_a_fault_that_passes_does_not_end_a_transfer(policy: AnyAgent, tmp_path: Path) -> None:
    result = transfer_into(tmp_path / "t", policy, broken_valve(end=28.0), WATCHED, seed=1)
    assert any(one["kind"] == "stuck-valve" for one in result["findings"])
    assert result["after"]["episodes"] == 6
