"""The board with a virtual arm: in lock-step, and behind a pseudo-terminal in real time."""

from collections.abc import Iterator
from time import monotonic, sleep

import numpy as np
import pytest

from pneumarm.arm.virtual import ArmParameters, VirtualArm, draw_parameters, without_noise
from tests.firmware import wire
from tests.firmware.board import SimulatedBoard, single_conversions, valves_of
from tests.firmware.build import missing
from tests.firmware.figures import Port, pseudo_terminal
from tests.firmware.host import SESSION
from tests.firmware.wire import CONSTANT, Reply

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing())
PERIOD = 1 / 30


def ask(board: SimulatedBoard, name: str, sequence: int, *values: int) -> Reply:
    """Send a request and read its reply as a serial port would give it."""
    board.write(wire.request(name, sequence, *values))
    frame = b""
    while not frame.endswith(b"\0"):
        byte = board.read(1, timeout=0.005)
        assert byte, "no reply"
        frame = (frame + byte).lstrip(b"\0")  # zeros between frames mean nothing
    return wire.reply(frame[:-1])


def ready(board: SimulatedBoard) -> SimulatedBoard:
    """Connect, configure and arm, with the sequences 1 to 3."""
    board.wait(0.05)
    ask(board, "CONNECT", 1, CONSTANT["VERSION"], SESSION)
    ask(board, "CONFIGURE", 2, 5, 16, *[1000] * CONSTANT["MUSCLES"])
    assert ask(board, "ARM", 3, SESSION).has("ARMED")
    return board


@pytest.fixture
def board() -> Iterator[SimulatedBoard]:
    with SimulatedBoard(single_conversions(VirtualArm(draw_parameters(3)))) as board:
        yield ready(board)


def test_valves_of_pins_are_the_codes() -> None:
    setting = {"IN": 1, "CLOSED": 0, "OUT": -1}
    for names in (["IN", "OUT", "CLOSED", "IN"], ["OUT", "OUT", "IN", "CLOSED"]):
        expected = np.array([setting[name] for name in names]).reshape(2, 2)
        np.testing.assert_array_equal(valves_of(wire.pins_of(wire.valves(*names)), 2), expected)
    with pytest.raises(AssertionError, match="muscle 2"):
        valves_of(0b0100, 1)


def test_the_arm_moves_as_its_valves_say(board: SimulatedBoard) -> None:
    readings = []
    for turn in range(40):
        ways = ("IN", "OUT") if turn < 20 else ("OUT", "IN")
        readings.append(ask(board, "EXCHANGE", 4 + turn, wire.valves(*ways)))
        board.wait(PERIOD)
    start, there, back = (readings[i].angle[0] for i in (0, 20, 39))
    assert there > start + 100
    assert back < there - 200
    assert readings[20].pressure[0] > readings[0].pressure[0] + 50
    assert readings[39].pressure[1] > readings[20].pressure[1] + 50
    assert readings[3].velocity[0] > 0 > readings[24].velocity[0]


def test_readings_are_those_of_the_same_arm_without_the_board() -> None:
    """Valves and sensors through the chip agree with the arm itself, to a few counts."""
    parameters = without_noise(ArmParameters())
    direct = VirtualArm(parameters)
    with SimulatedBoard(single_conversions(VirtualArm(parameters))) as board:
        ready(board)
        # The arm rests vented until it is armed, and both go on from the same moment.
        direct.set_valves(np.full((1, 2), -1, np.int8))
        direct.wait(board.time)
        rng = np.random.default_rng(4)
        for turn in range(30):
            ways = rng.integers(-1, 2, 2)
            names = [("OUT", "CLOSED", "IN")[way + 1] for way in ways]
            reply = ask(board, "EXCHANGE", 4 + turn, wire.valves(*names))
            reading = direct.read()
            # A turn through the board is later by the time on the line, over which the arm moves on.
            assert abs(reply.angle[0] - reading.angle[0]) <= 12
            np.testing.assert_allclose(reply.pressure[:2], reading.pressure[0], atol=6)
            direct.set_valves(ways.reshape(1, 2).astype(np.int8))
            direct.wait(board.time + PERIOD - direct.time)
            board.wait(PERIOD)


def test_silence_vents_the_arm(board: SimulatedBoard) -> None:
    for turn in range(15):
        reply = ask(board, "EXCHANGE", 4 + turn, wire.valves("IN", "IN"))
        board.wait(PERIOD)
    assert min(reply.pressure[:2]) > 30
    board.wait(3.0)
    vented = ask(board, "READ", 30)
    assert vented.has("DEAD_MAN")
    assert max(vented.pressure[:2]) < 8


def test_same_seed_same_run() -> None:
    def run() -> list[Reply]:
        with SimulatedBoard(single_conversions(VirtualArm(draw_parameters(2)), seed=5)) as board:
            ready(board)
            return [ask(board, "EXCHANGE", 4 + turn, wire.valves("IN")) for turn in range(5)]

    assert run() == run()


def test_behind_a_pseudo_terminal_in_real_time() -> None:
    """A process of its own, its line opened like a serial port."""
    with pseudo_terminal("virtual:seed=1") as path:
        port = Port(path)
        assert port.ask("CONNECT", 1, CONSTANT["VERSION"], SESSION).session == SESSION
        asked, before = monotonic(), port.ask("READ", 2)
        sleep(0.5)
        after, heard = port.ask("READ", 3), monotonic()
        port.close()
        # On a busy machine the board lets time go.
        assert 0.1 < (after.time - before.time) * 1e-6 < heard - asked + 0.01
