"""Write the firmware that came with this package onto a board, by avrdude."""

import os
import shutil
import subprocess
from pathlib import Path

from pneumarm.errors import ArmFailure, UnusableInput

FIRMWARE = Path(__file__).with_name("pneumarm.hex")
"""The program of the board, as ``make -C firmware package`` leaves it here."""
BAUDS = (115_200, 57_600)
"""Of boot loaders [symbols/s]: on an Uno and a Nano of after 2018, then on an older Nano."""
LONGEST = 120.0
"""avrdude is ended after this time [s]; it takes five."""


def flash(port: str, program: Path = FIRMWARE) -> int:
    """Flash the board at ``port`` with a ``program``; return the speed of its boot loader [symbols/s].

    Raises:
        UnusableInput: there is no such port, or no avrdude on this computer.
        ArmFailure: avrdude could not do it; with what it said.

    """
    avrdude = shutil.which("avrdude")
    if avrdude is None:
        raise UnusableInput(
            "avrdude is not on this computer. Debian: apt install avrdude; macOS: brew install avrdude; Windows: "
            "winget install AVRDudes.AVRDUDE"
        )
    if not os.path.exists(port):
        raise UnusableInput(f"{port}: no such port; is the board plugged in?")
    said = ""
    for baud in BAUDS:
        command = [avrdude, "-p", "atmega328p", "-c", "arduino", "-P", port, "-b", str(baud), "-D"]
        try:
            done = subprocess.run(
                [*command, "-U", f"flash:w:{program}:i"], capture_output=True, text=True, timeout=LONGEST
            )
        except subprocess.TimeoutExpired as error:
            raise ArmFailure(
                f"{port}: avrdude did not end within {LONGEST:g} s; unplug the board and try again"
            ) from error
        if done.returncode == 0:
            return baud
        said = done.stderr.strip() or done.stdout.strip()
    raise ArmFailure(f"{port}: the board could not be flashed. avrdude said: {said}")
