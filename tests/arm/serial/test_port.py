"""Serial ports: one program each, its holder named; opened again after the plug was out."""

import os
import pty
import subprocess
import sys
import time
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest

from children import child
from pneumarm.arm.serial.port import SerialPort
from pneumarm.errors import UnusableInput

pytestmark = pytest.mark.skipif(not Path("/proc/locks").exists(), reason="the holder is known on Linux only")
OPEN = """
import sys
from pneumarm.arm.serial.port import SerialPort
port = SerialPort(sys.argv[1])
print("open", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def terminal() -> Iterator[tuple[int, str]]:
    master, slave = pty.openpty()
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    os.close(master)
    os.close(slave)


def test_second_process_is_refused_and_told_who_holds_the_port(terminal: tuple[int, str]) -> None:
    command = [sys.executable, "-c", OPEN, terminal[1]]
    with child(*command, stdin=subprocess.PIPE) as first:
        assert first.stdout is not None
        assert first.stdout.readline() == "open\n"
        with pytest.raises(UnusableInput, match=rf"in use by process {first.pid} \(python.*\); end that first"):
            SerialPort(terminal[1])
    SerialPort(terminal[1]).close()  # nothing is left locked


def test_bytes_go_both_ways_and_waiting_ends(terminal: tuple[int, str]) -> None:
    port = SerialPort(terminal[1])
    port.write(b"\1\2\0")
    assert os.read(terminal[0], 10) == b"\1\2\0"
    os.write(terminal[0], b"\3\0\4")
    assert port.read(1.0) == b"\3\0\4"
    begun = time.monotonic()
    assert port.read(0.02) == b""
    assert time.monotonic() - begun > 0.015
    port.close()
    port.close()


def test_a_port_that_is_gone_raises_at_once_and_opens_again_when_it_is_back(tmp_path: Path) -> None:
    place = tmp_path / "ttyARM"
    first, slave = pty.openpty()
    place.symlink_to(os.ttyname(slave))
    port = SerialPort(str(place))
    os.close(slave)
    os.close(first)  # the plug is out
    with pytest.raises(OSError):  # noqa: PT011 - whatever the system calls it
        port.read(0.1)
    place.unlink()
    with pytest.raises(OSError, match="no such port"):
        port.reopen()
    second, slave = pty.openpty()
    tty.setraw(slave)
    place.symlink_to(os.ttyname(slave))
    port.reopen()
    port.write(b"\5\0")
    assert os.read(second, 10) == b"\5\0"
    port.close()
    os.close(second)
    os.close(slave)
