"""A line over a serial port, USB or not."""

import os
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from serial.tools import list_ports

import serial
from pneumarm.arm.serial.line import Line
from pneumarm.arm.serial.protocol import BAUD
from pneumarm.errors import UnusableInput


class SerialPort(Line):
    """The serial port at ``path``, for this process alone.

    Raises:
        UnusableInput: there is no such port, it may not be opened, or another program has it.

    """

    def __init__(self, path: str) -> None:
        self._path = path
        self._port = _opened(path)
        self._usb = _usb_of(path)

    def reopen(self) -> None:
        """Open the port again, as after the plug was out; where its USB device is at another one by now, that.

        Raises:
            OSError: it is still gone, or another program took it.

        """
        self.close()
        path = self._path if self._usb is None else _path_of(self._usb, self._path)
        try:
            self._port = _opened(path)
        except UnusableInput as error:
            raise OSError(str(error)) from error

    def write(self, data: bytes) -> None:
        """Send ``data``."""
        try:
            self._port.write(data)
        except serial.SerialException as error:
            raise OSError(str(error)) from error

    def read(self, timeout: float) -> bytes:
        """Return what came, waiting up to ``timeout`` [s] for the first byte."""
        try:
            self._port.timeout = timeout
            first = self._port.read(1)
            return first + self._port.read(self._port.in_waiting) if first else b""
        except (serial.SerialException, TypeError) as error:  # TypeError: closed by another thread
            raise OSError(str(error)) from error

    def now(self) -> float:
        """Return the monotonic time [s]."""
        return time.monotonic()

    def sleep_until(self, time_: float) -> None:
        """Return at ``time_`` [s] or a little later."""
        remaining = time_ - time.monotonic()
        if remaining > 0:
            time.sleep(remaining)

    def close(self) -> None:
        """Close the port."""
        with suppress(OSError, serial.SerialException):
            self._port.close()


def boards() -> list[tuple[str, str]]:
    """Return the path of each USB serial port, and what is there."""
    return [(port.device, str(port.description)) for port in list_ports.comports() if port.vid is not None]


def _usb_of(path: str) -> tuple[object, ...] | None:
    """Return by what the USB device at ``path`` is known again; None where nothing tells it from others."""
    for port in list_ports.comports():
        if os.path.realpath(port.device) == os.path.realpath(path):
            return _identity(port)
    return None


def _identity(port: Any) -> tuple[object, ...] | None:
    """Return maker, product and serial number of a USB device, its socket in place of a number that is missing."""
    return (port.vid, port.pid, port.serial_number or port.location) if port.vid is not None else None


def _path_of(usb: tuple[object, ...], before: str) -> str:
    """Return where the device ``usb`` is now, that was at ``before``; OSError where it is nowhere."""
    found = [port.device for port in list_ports.comports() if _identity(port) == usb]
    if not found:
        raise OSError(f"the board that was at {before} is at no port")
    return before if os.path.realpath(before) in map(os.path.realpath, found) else str(found[0])


def _opened(path: str) -> serial.Serial:
    """Return the port at ``path``, opened.

    Opening it resets an Uno or Nano: where another program uses it, that is not even tried.
    """
    holder = _holder(path)
    if holder is not None:
        raise UnusableInput(f"serial:{path}: in use by {holder}; end that first")
    try:
        # exclusive: two programs on one port would each get half of the other's replies.
        port = serial.Serial(path, BAUD, timeout=0, exclusive=True)
    except (serial.SerialException, ValueError, OSError) as error:
        raise UnusableInput(f"serial:{path}: {_advice(path, error)}") from error
    _lower_latency(path, port)
    return port


def _lower_latency(path: str, port: serial.Serial) -> None:
    """Have bytes delivered at once where the driver can: an FTDI chip else keeps them for up to 16 ms."""
    with suppress(OSError, ValueError, AttributeError, NotImplementedError):
        port.set_low_latency_mode(True)
    timer = Path("/sys/bus/usb-serial/devices") / Path(path).resolve().name / "latency_timer"
    with suppress(OSError):
        timer.write_text("1")


def _holder(path: str) -> str | None:
    """Return the name of a process that uses ``path``, where the system tells: who locked it, or has it open."""
    try:
        wanted = os.stat(path)
    except OSError:
        return None
    held = _locked_by(wanted)
    # The program behind a pseudo-terminal has it open too, and is its other end.
    if held is None and not os.path.realpath(path).startswith("/dev/pts/"):
        held = _opened_by(wanted)
    if held is None:
        return None
    name = ""
    with suppress(OSError):
        name = f" ({Path(f'/proc/{held}/comm').read_text().strip()})"
    return f"process {held}{name}" if held != os.getpid() else "this process itself"


def _locked_by(wanted: os.stat_result) -> int | None:
    """Return the process that has locked a file."""
    place = f"{os.major(wanted.st_dev):02x}:{os.minor(wanted.st_dev):02x}:{wanted.st_ino}"
    with suppress(OSError):
        for line in Path("/proc/locks").read_text().splitlines():
            fields = line.split()  # 1: FLOCK ADVISORY WRITE process device:device:inode begin end
            if fields[1] == "FLOCK" and fields[-3] == place and int(fields[-4]) > 0:
                return int(fields[-4])
    return None


def _opened_by(wanted: os.stat_result) -> int | None:
    """Return another process that has a file open."""
    for process in Path("/proc").glob("[0-9]*"):
        if int(process.name) == os.getpid():
            continue
        with suppress(OSError):
            for descriptor in (process / "fd").iterdir():
                with suppress(OSError):
                    found = descriptor.stat()
                    if (found.st_dev, found.st_ino) == (wanted.st_dev, wanted.st_ino):
                        return int(process.name)
    return None


def _advice(path: str, error: Exception) -> str:
    """Return what to do about ``error``."""
    if not os.path.exists(path):
        found = ", ".join(port.device for port in list_ports.comports()) or "none"
        return f"no such port; ports found: {found}. Is the board plugged in?"
    if isinstance(error, PermissionError) or "Permission" in str(error):
        group = ""
        if sys.platform != "win32":
            import grp

            with suppress(KeyError):
                group = f" (group {grp.getgrgid(os.stat(path).st_gid).gr_name})"
        return f"you may not open it; become a member of the group that owns it{group}, and log in again"
    if "lock" in str(error) or "busy" in str(error).lower():
        return "in use by another program; end that first"
    return f"cannot be opened ({error})"
