"""A board that drives alone: it settles at goals, understands what is typed, and vents where something is wrong."""

import json
import os
import random
import shutil
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from learning.in_c import InC
from pneumarm.arm.virtual import VirtualArm
from pneumarm.cli import main
from pneumarm.control.deploy import BOARDS, Built, deploy
from pneumarm.errors import UnusableInput
from pneumarm.learning import ServoSettings
from pneumarm.learning.servo.agent import ServoAgent, train_servo
from pneumarm.learning.servo.board import BoardController, quantised
from pneumarm.learning.servo.task import servo_sizes
from pneumarm.networks.layers import initial_weights
from pneumarm.simulation import Simulation
from pneumarm.task.begin import begin_states
from pneumarm.transitions import Store
from tests.firmware.alone import Alone, Typist, goals_of, variables
from tests.firmware.board import valves_of
from tests.firmware.build import missing
from tests.firmware.chip import FREQUENCY, Change, Chip
from tests.firmware.second_machine import SecondChip
from tests.firmware.second_machine import missing as second_missing

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing())
ANGLE, PRESSURES = 0, (1, 2)
"""Analog channels of the joint."""
MIDDLE, AIR = 512, 80
PERIOD = 1 / 30


def untrained(simulation: Simulation, hidden: tuple[int, ...] = (48, 48)) -> ServoAgent:
    """Return a servo that opens valves at random."""
    settings = ServoSettings(hidden=hidden, coarse=0.2)
    weights = initial_weights(servo_sizes(simulation, settings), 3.0, np.random.default_rng(0))
    return ServoAgent(simulation, weights, settings)


@pytest.fixture(scope="module")
def simulation(small_run: Path) -> Simulation:
    return Simulation.load(small_run / "simulation.safetensors")


@pytest.fixture(scope="module")
def built(simulation: Simulation, tmp_path_factory: pytest.TempPathFactory) -> Built:
    return deploy(untrained(simulation), "uno", tmp_path_factory.mktemp("uno"))


@pytest.fixture
def typist(built: Built) -> Iterator[Typist]:
    """A board on a table: its sensors say what a test sets."""
    with Chip(built.hex) as chip:
        chip.set_count(ANGLE, MIDDLE)
        for channel in PRESSURES:
            chip.set_count(channel, AIR)
        chip.run(0.05)
        yield Typist(chip)


@pytest.fixture
def driving(typist: Typist) -> Typist:
    assert typist.type("arm") == "ok"
    assert "driving" in typist.type("where")
    return typist


def vented(chip: Chip) -> bool:
    return chip.valve_pins == 0


def never_both_open(chip: Chip) -> None:
    for change in chip.changes:
        valves_of(change.pins & 0xFF, 2)  # raises where an inlet and its exhaust are open


@pytest.mark.thorough
def test_without_a_host_it_settles_at_goals(
    simulation: Simulation, small_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with Store.open(small_run / "transitions.db") as store:
        begin = begin_states(store.blocks(), simulation.window, simulation.scaling, store.spec)
    agent = train_servo(simulation, begin, ServoSettings(agents=1, updates=400)).agent
    built = deploy(agent, "uno", tmp_path)
    with Alone(built, VirtualArm(seed=3)) as alone:
        alone.board.wait(0.1)
        assert alone.type("arm") == "ok"
        held = [alone.hold(goal) for goal in goals_of(agent, 12, 0)]
        last, longest = alone.decisions()
        assert alone.type("sine 0.5 15") == "ok"
        alone.board.wait(3.0)
        assert "driving" in alone.type("where")
        _, longest_of_a_swing = alone.decisions()
        stack = alone.stack
        never_both_open(alone.board.chip)
    with capsys.disabled():
        print(f"\na decision takes {last:.0f} cycles, at most {max(longest, longest_of_a_swing):.0f};")
        print(f"{built.flash} bytes of flash, {built.memory} of RAM, {stack} of stack at most")
    assert sum(one.settled is not None for one in held) >= 11
    assert np.median([one.rest for one in held]) < 0.5
    assert 1e3 * longest / 16e6 < built.milliseconds  # what deploy says is no less
    assert 1e3 * longest_of_a_swing / 16e6 < 1.15 * built.milliseconds
    assert 0 < stack < BOARDS["uno"].stack


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
def test_the_board_decides_as_c_on_this_machine_to_the_last_bit(
    simulation: Simulation, built: Built, driving: Typist, tmp_path: Path
) -> None:
    agent, chip, at = untrained(simulation), driving.chip, variables(built)
    on_the_host = InC(agent, tmp_path, quantised(agent), compiler="gcc", single=True)
    rng, pressure, length = np.random.default_rng(1), np.full(2, float(AIR)), BoardController(agent).path_length

    def word(name: str, size: int, number: int = 0) -> bytes:
        return bytes(chip.peek(at[name] + size * number + i) for i in range(size))

    goal, begins, angle = float(MIDDLE), True, float(MIDDLE)
    assert driving.type("stop") == "ok"
    turns, found, opened = 0, [], 0
    chip.write(b"arm\n")
    turned = word("next_us", 4)
    while turns < 150:
        while word("next_us", 4) == turned:
            chip.run(0.0005)
        chip.run(0.022)
        turned = word("next_us", 4)  # whole by now
        command = on_the_host.next(begins, np.array([angle]), pressure[None], np.full((length, 1), goal))
        found.append(np.frombuffer(word("board_command", 8), np.float32) == command.ravel().astype(np.float32))
        begins, turns, opened = False, turns + 1, opened + int(np.any(command))
        angle = float(np.clip(round(goal + rng.normal(0, 200 * 0.97**turns + 4)), 1, 1022))
        pressure = np.clip(np.round(pressure + rng.normal(0, 4, 2)), 0, 170)
        chip.set_count(ANGLE, int(angle))
        for channel, value in zip(PRESSURES, pressure, strict=True):
            chip.set_count(channel, int(value))
    assert np.all(found)
    assert 20 < opened < turns  # of the others it is at rest


def moved_alone(chip: Chip | SecondChip) -> list[Change]:
    """Return how the pins of a board changed that held a goal while its sensors said the same as another one's."""
    rng = random.Random(2)
    typist, angle = Typist(chip), float(MIDDLE)
    for channel, count in ((ANGLE, MIDDLE), *((channel, AIR) for channel in PRESSURES)):
        chip.set_count(channel, count)
    chip.run_until(round(0.05 * FREQUENCY))
    assert typist.type("arm", 0.001) in ("", "ok")
    for turn in range(120):
        chip.run_until(round((0.05 + 0.025 + turn * PERIOD) * FREQUENCY))  # not while it reads
        angle = MIDDLE + 150 * 0.96**turn * rng.uniform(-1, 1)
        chip.set_count(ANGLE, round(angle))
        chip.set_count(PRESSURES[0], rng.randrange(60, 170))
    return chip.changes


@pytest.mark.thorough
@pytest.mark.skipif(bool(second_missing()), reason=second_missing())
def test_a_second_simulator_agrees_move_for_move(built: Built) -> None:
    with Chip(built.hex) as chip, SecondChip(built.hex) as other:
        one, two = moved_alone(chip), moved_alone(other)
    assert len(one) > 40
    assert [change.pins & 0xFF for change in one] == [change.pins & 0xFF for change in two]
    assert max(abs(a.cycle - b.cycle) for a, b in zip(one, two, strict=True)) < 0.5e-3 * FREQUENCY


def test_nothing_moves_until_somebody_arms_it(typist: Typist) -> None:
    assert typist.type("where").startswith("0.0 deg, goal ")
    assert "type arm" in typist.type("goto 10")
    typist.chip.run(1.0)
    assert vented(typist.chip)
    assert typist.type("arm") == "ok"
    typist.chip.run(0.5)
    assert not vented(typist.chip)
    assert typist.type("stop") == "ok"
    typist.chip.run(0.5)
    assert vented(typist.chip)
    typist.chip.reset("BROWN_OUT")
    typist.chip.run(0.5)
    assert vented(typist.chip)
    assert "since the board began" in typist.type("where")


def test_what_is_typed_is_answered(driving: Typist) -> None:
    for line in ("goto 20", "goto  -5.25 ", "sine 0.5 20", "hold", "alone 0"):
        assert driving.type(line) == "ok", line
    assert driving.type("goto 12.3") == "ok"
    assert driving.type("where") == "0.0 deg, goal 12.3, driving"
    assert driving.type("air") == f"{AIR / 166:.2f} and {AIR / 166:.2f} bar"
    assert driving.type("turn").startswith("decided in ")
    for line in ("goto 170", "goto -99", "sine 0.5 80", "sine 9 5", "sine 0.5 -3"):
        assert driving.type(line).startswith("goals are -"), line
    for line in ("fly", "goto", "goto x", "goto 1 2", "goto 99999999", "sine 1", "armed", "ARM", "goto 1.2.3", "-"):
        assert driving.type(line).startswith("? arm goto"), line
    for line in ("goto\t5", "goto 5" + 30 * " ", b"\xff\x80goto 5"):
        assert driving.type(line) == "?", line
    assert driving.type("where") == "0.0 deg, goal 12.3, driving"


@pytest.mark.parametrize("count", [0, 1023])
def test_a_dead_angle_sensor_vents(driving: Typist, count: int) -> None:
    driving.chip.set_count(ANGLE, count)
    driving.chip.run(5 * PERIOD)
    assert vented(driving.chip)
    assert "end of its range" in driving.type("where")
    driving.chip.set_count(ANGLE, MIDDLE)
    driving.chip.run(1.0)
    assert vented(driving.chip)  # until somebody has looked, and armed again
    assert driving.type("arm") == "ok"


def test_a_joint_may_lie_at_the_end_of_its_range_unless_it_is_wanted_elsewhere(driving: Typist) -> None:
    for count in (600, 700, 800, 900, 1000, 1023):
        driving.chip.set_count(ANGLE, count)
        driving.chip.run(2 * PERIOD)
    assert driving.type("hold") == "ok"
    driving.chip.run(5.0)
    assert "driving" in driving.type("where")
    assert driving.type("goto 0") == "ok"
    driving.chip.run(1.5)
    assert "driving" in driving.type("where")  # it may be on its way
    driving.chip.run(1.0)
    assert "end of its range" in driving.type("where")
    assert vented(driving.chip)


def test_over_pressure_vents_at_once_and_stays(driving: Typist) -> None:
    driving.chip.set_count(PRESSURES[0], 300)
    begun = driving.chip.cycle
    driving.chip.run(3 * PERIOD)
    off = [change.cycle for change in driving.chip.changes if change.cycle > begun and not change.pins & 0x03]
    assert (off[0] - begun) / 16e3 < 2.5  # ms
    assert vented(driving.chip)
    assert driving.type("arm").startswith("not yet")
    driving.chip.set_count(PRESSURES[0], AIR)
    driving.chip.run(0.1)
    assert vented(driving.chip)
    assert driving.type("arm") == "ok"


def test_inlets_stay_closed_over_the_controllers_limit(driving: Typist) -> None:
    for channel in PRESSURES:
        driving.chip.set_count(channel, 180)  # over 1.05 bar, below the latch
    driving.chip.run(2 * PERIOD)
    begun = driving.chip.cycle
    for goal in (30, -30, 10):
        driving.type(f"goto {goal}")
        driving.chip.run(0.5)
    assert not any(change.pins & 0x05 for change in driving.chip.changes if change.cycle > begun)
    assert "driving" in driving.type("where")


def test_a_muscle_that_never_fills_is_not_blown_at_for_ever(driving: Typist) -> None:
    """As where the supply is gone, or a hose: pressures that stay at nothing, and a goal that is never reached."""
    for channel in PRESSURES:
        driving.chip.set_count(channel, 0)
    driving.type("goto 30")
    begun = driving.chip.cycle
    driving.chip.run(25.0)
    for inlet in (0x01, 0x04):
        longest, since = 0, None
        for change in [*driving.chip.changes, driving.chip.changes[-1]._replace(cycle=driving.chip.cycle)]:
            if since is not None:
                longest = max(longest, change.cycle - since)
            since = (since or change.cycle) if change.pins & inlet else None
        assert longest / 16e6 < 10.2
    never_both_open(driving.chip)
    assert driving.chip.cycle > begun


def test_a_hang_vents_and_is_told(driving: Typist) -> None:
    driving.chip.hang()
    driving.chip.run(0.3)
    assert vented(driving.chip)
    assert len(driving.chip.resets) == 1
    assert "since the board began" in driving.type("where")


def test_nobody_there_is_a_reason_to_vent_where_that_was_asked_for(driving: Typist) -> None:
    driving.chip.run(3.0)
    assert not vented(driving.chip)  # by default it goes on alone
    assert driving.type("alone 1") == "ok"
    driving.chip.run(0.8)
    assert not vented(driving.chip)
    driving.chip.run(0.4)
    assert vented(driving.chip)
    assert "nobody typed" in driving.type("where")


def test_random_bytes_move_nothing(driving: Typist) -> None:
    driving.type("goto 5")
    rng = random.Random(0)
    for _ in range(50):
        driving.chip.write(rng.randbytes(2000))
        driving.chip.run(0.045)
    driving.chip.run(0.2)
    assert driving.type("").count("?") <= 1
    assert driving.type("where") == "0.0 deg, goal 5.0, driving"
    never_both_open(driving.chip)
    assert driving.chip.resets == []


def test_what_does_not_fit_is_said_with_what_would(simulation: Simulation, tmp_path: Path) -> None:
    with pytest.raises(UnusableInput, match=r"does not fit: .* --servo.hidden \d+,\d+"):
        deploy(untrained(simulation, (96, 96)), "uno", tmp_path)
    with pytest.raises(UnusableInput, match=r"does not fit: a decision takes"):
        deploy(untrained(simulation, (160, 160)), "uno", tmp_path)
    with pytest.raises(UnusableInput, match="no such board"):
        deploy(untrained(simulation), "mega", tmp_path)
    spec = replace(simulation.spec, pressure_sensors=False, safe_supply=True)
    with pytest.raises(UnusableInput, match="pressure sensors"):
        deploy(untrained(replace(simulation, spec=spec)), "uno", tmp_path)
    with pytest.raises(UnusableInput, match="no sources of boards"):
        deploy(untrained(simulation), "uno", tmp_path, tmp_path)


def test_from_an_agent_to_a_board_by_commands(
    simulation: Simulation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A stand-in for avrdude keeps what it is to flash; that it drives is what other tests show."""
    agent, port, flashed = tmp_path / "arm.agent", tmp_path / "port", tmp_path / "flashed.hex"
    untrained(simulation).save(agent)
    port.touch()
    avrdude = tmp_path / "avrdude"
    avrdude.write_text(
        f"#!{sys.executable}\nimport shutil, sys\n"
        f"shutil.copy(sys.argv[-1].removeprefix('flash:w:').removesuffix(':i'), {str(flashed)!r})\n"
    )
    avrdude.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    for command in (["deploy", agent, "--out", tmp_path / "out", "--json"], ["arm", "flash", port, "--agent", agent]):
        with pytest.raises(SystemExit) as ended:
            main([str(word) for word in command])
        assert ended.value.code == 0
    told = json.loads(capsys.readouterr().out.splitlines()[0])
    assert told["flash"] < BOARDS["uno"].flash
    with Chip(flashed) as chip:
        chip.set_count(ANGLE, MIDDLE)
        chip.run(0.05)
        assert Typist(chip).type("arm") == "ok"
        assert Typist(chip).type("where") == "0.0 deg, goal 0.0, driving"
