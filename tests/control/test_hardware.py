"""Hardware fails and stalls where a virtual arm never does: nothing recorded is lost, and moving goes on."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from children import python
from pneumarm.adaptation import AdaptationSettings, RefitSettings
from pneumarm.arm import Reading
from pneumarm.arm.serial import BoardLine, EmulatedBoard, FaultyLine, SerialArm
from pneumarm.arm.virtual import VirtualArm, draw_parameters
from pneumarm.control import Monitor, TransferSettings, transfer, transfer_into
from pneumarm.errors import ArmFailure
from pneumarm.learning import Agent, AnyAgent, PolicySettings, train
from pneumarm.simulation import Simulation
from pneumarm.task import begin_states
from pneumarm.transitions import KINDS, CollectBegin, CollectSettings, Store, collect

QUICK = CollectSettings(actions=150, begin=CollectBegin(deflate=0.5, inflate=0.5, settle=0.3))
SHORT = TransferSettings(episodes=12, test_episodes=6)


class LooseLine(FaultyLine):
    """A line whose plug falls out, or whose wire breaks, at a certain request."""

    def __init__(self, board: EmulatedBoard, left: int, *, silently: bool = False) -> None:
        super().__init__(BoardLine(board))
        self.left, self.silently = left, silently

    def write(self, data: bytes) -> None:
        self.left -= 1
        if self.left < 0:
            self.cut, self.unplugged = self.silently, not self.silently
        super().write(data)


def emulated(left: int = 10**9, *, silently: bool = False) -> SerialArm:
    """Return arm 3 behind an emulated board that is lost after ``left`` requests, in lock-step."""
    arm = VirtualArm(draw_parameters(3), seed=1)
    return SerialArm(LooseLine(EmulatedBoard(arm), left, silently=silently), replace(arm.spec, name="emulated"))


class Noting(Monitor):
    """A monitor that also notes the times of what it sees."""

    def begin(self, *, at_rest: bool) -> None:
        self.seen: list[list[float]] = [*getattr(self, "seen", []), []]
        super().begin(at_rest=at_rest)

    def see(self, reading: Reading, valves: NDArray[np.int8] | None) -> None:
        self.seen[-1].append(reading.time)
        super().see(reading, valves)


def times(store: Store) -> list[list[float]]:
    """Return the times of the rows of every sequence, marked ones too."""
    found: dict[int, list[float]] = {}
    for block in store.blocks(marked=True):
        for number, time in zip(block.sequence.tolist(), block.time.tolist(), strict=True):
            found.setdefault(number, []).append(time)
    return list(found.values())


@pytest.mark.parametrize("silently", [False, True])
def test_no_row_is_lost_when_the_link_is_while_collecting(tmp_path: Path, silently: bool) -> None:
    arm = emulated(850, silently=silently)
    path, watch = tmp_path / "arm.db", Noting(arm.spec)
    with Store.for_arm(path, arm.spec) as store, pytest.raises(ArmFailure, match="it vents all muscles") as failure:
        collect(arm, store, 2_000, settings=QUICK, watch=watch)
    assert failure.value.exit_code == 1
    with Store.open(path) as store:
        noted = [sequence for sequence in watch.seen if sequence]
        assert times(store) == [pytest.approx(sequence, abs=1e-9) for sequence in noted]
        assert len(noted[-1]) < QUICK.actions  # it is the broken one
        last = store.sequences
        (mark,) = store.marks(last)[last]
        assert mark.reason.startswith("broke off here: emulated: ")
        assert (mark.first, mark.last) == (len(noted[-1]) - 1, len(noted[-1]) - 1)
        assert [e.transitions for e in store.catalogue()][-1] == len(noted[-1]) - 2
        store.check()
    again = emulated()
    with Store.for_arm(path, again.spec) as store:
        result = collect(again, store, 2_000, settings=QUICK)
        assert result.transitions >= 2_000
        assert result.sequences == store.sequences > last
        store.check()


def test_an_arm_that_can_repeat_a_sequence_stores_whole_ones_only(tmp_path: Path) -> None:
    class Failing(VirtualArm):
        left = 500

        def read(self) -> Reading:
            self.left -= 1
            if self.left < 0:
                raise OSError("cable")
            return super().read()

    arm = Failing(draw_parameters(3), seed=1)
    with Store.for_arm(tmp_path / "arm.db", arm.spec) as store:
        with pytest.raises(ArmFailure, match="OSError: cable"):
            collect(arm, store, 2_000, settings=QUICK)
        assert {entry.rows for entry in store.catalogue()} == {QUICK.actions + 1}


@pytest.fixture(scope="module")
def agent(small_run: Path) -> Agent:
    return Agent.load(small_run / "agent.safetensors")


@pytest.fixture(scope="module")
def policy(small_run: Path) -> AnyAgent:
    settings = PolicySettings(
        agents=1, updates=5, arms=16, steps=16, hidden=(8,), validation_episodes=20, lookahead=8
    )
    simulation = Simulation.load(small_run / "simulation.safetensors")
    with Store.open(small_run / "transitions.db") as store:
        begin = begin_states(store.blocks(kinds=KINDS), simulation.window, simulation.scaling, simulation.spec)
    return train(simulation, begin, settings).agent


def test_finished_movements_are_kept_when_the_link_is_lost_in_a_transfer(agent: Agent, tmp_path: Path) -> None:
    folder, arm, stored = tmp_path / "moved", emulated(), []

    def pull_out(done: float, total: float) -> None:
        with Store.open(folder / "transitions.db") as store:
            stored.append(store.sequences)
        if done == 5:
            arm._line.left = 97  # type: ignore[attr-defined]  # in the next movement

    with pytest.raises(ArmFailure, match="not found again within 10 min"):
        transfer_into(folder, agent, arm, SHORT, seed=1, progress=pull_out)
    assert stored == [1, 2, 3, 4, 5]  # each as soon as it is made: a process that is killed then loses none
    with Store.open(folder / "transitions.db") as store:
        kinds = [entry.kind for entry in store.catalogue()]
        assert kinds == ["episode"] * 5 + ["broken episode"]
        broken = store.marks(6)[6]
    assert "broke off here" in broken[0].reason
    with pytest.raises(ArmFailure, match="not found again within 10 min"):
        transfer_into(folder, agent, emulated(300), SHORT, seed=1)
    result = transfer_into(folder, agent, emulated(), SHORT, seed=1)
    assert [result[phase]["episodes"] for phase in ("before", "after")] == [6, 6]
    assert result["episodes"] == 12
    with Store.open(folder / "transitions.db") as store:
        kinds = [entry.kind for entry in store.catalogue()]
        assert kinds.count("episode") == 24
        store.check()


ADAPTING = TransferSettings(
    episodes=9,
    test_episodes=4,
    adaptation=AdaptationSettings(every=4, updates=2, warm_up=1, refit=RefitSettings(gain=0.0, certainty=0.0)),
)


def test_a_transfer_goes_on_after_adapting_for_longer_than_the_dead_man_waits(
    policy: AnyAgent, tmp_path: Path
) -> None:
    arm = emulated()
    board = arm._line.line.board  # type: ignore[attr-defined]
    stalls = []

    def stall(version: int, adapted: AnyAgent) -> None:
        """Let the arm's time pass as a real one's does while an agent learns for seconds."""
        board.run_until(board.time + 3.0)
        stalls.append(board.armed)

    with arm, Store.for_arm(tmp_path / "arm.db", arm.spec) as store:
        moved = transfer(policy, arm, store, ADAPTING, seed=1, keep_version=stall)
    assert stalls == [False] * (1 + moved.adaptations)  # vented each time
    assert moved.adaptations > 0
    assert sum(made.n for made in moved.movements.values()) == 17


COUNTING = """
import gc, sys
from pathlib import Path
import numpy as np
from pneumarm.arm.virtual import VirtualArm
from pneumarm.control import Monitor, TransferSettings, open_agent, open_controller, transfer
from pneumarm.transitions import CollectSettings, Store, collect

class Enough(KeyboardInterrupt):
    pass

class Counting(VirtualArm):
    begun = 0
    counts = ()

    def make_ready(self):
        from numba.core.dispatcher import Dispatcher
        self.begun += 1
        if self.begun > 1:
            print(len(self.counts), *sorted(self.counts[-1] - self.counts[0]))
            raise Enough
        self.kernels = [
            one
            for one in gc.get_objects()
            if isinstance(one, Dispatcher) and not one.__module__.startswith("pneumarm.arm.virtual")
        ]
        self.counts = []

    def set_valves(self, valves):
        if self.counts != ():
            self.counts.append({f"{one.__module__}.{one.__name__}" for one in self.kernels if one.overloads})
        super().set_valves(valves)

arm = Counting(seed=3)
for value in (1, 0, -1):
    arm.set_valves(np.full((1, 2), value, np.int8))
    arm.wait(0.05)
with Store.for_arm(Path(sys.argv[1]) / "arm.db", arm.spec) as store:
    try:
        if sys.argv[2] == "transfer":
            transfer(open_agent(Path(sys.argv[3])), arm, store, TransferSettings(episodes=2, test_episodes=1))
        else:
            with open_controller(sys.argv[3], arm) as controller:
                settings, watch = CollectSettings(actions=30), Monitor(arm.spec)
                collect(arm, store, 2_000, settings=settings, controller=controller, watch=watch)
    except Enough:
        pass
"""


@pytest.mark.parametrize(
    ("job", "what"),
    [("transfer", "agent"), ("transfer", "policy"), ("transfer", "simulation"), ("collect", "random")],
)
def test_nothing_is_compiled_while_an_arm_moves(
    small_run: Path, policy: AnyAgent, tmp_path: Path, job: str, what: str
) -> None:
    policy.save(tmp_path / "policy")
    files = {
        "policy": tmp_path / "policy",
        "agent": small_run / "agent.safetensors",
        "simulation": small_run / "simulation.safetensors",
    }
    done = python("-c", COUNTING, tmp_path, job, files.get(what, what), check=True)
    turns, *compiled = done.stdout.split()
    assert int(turns) > 5
    assert not compiled
