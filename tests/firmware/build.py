"""Build what the tests of the firmware run: the .hex itself, the simulated board, the decoder for this machine."""

import fcntl
import functools
import hashlib
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

HERE = Path(__file__).parent
FIRMWARE = HERE.parents[1] / "firmware"
BUILD = FIRMWARE / "build"
BOARD = "uno"
"""The board that the tests are of."""
_DATA, _EEPROM = 0x800000, 0x810000
"""Where the linker puts the data memory and the EEPROM."""
PACKAGES = "gcc-avr avr-libc libsimavr-dev libelf-dev make gcc"


def _has_header(compiler: str, header: str) -> bool:
    command = [compiler, "-E", "-", "-o", "/dev/null"]
    return subprocess.run(command, input=f"#include <{header}>", capture_output=True, text=True).returncode == 0


@functools.cache
def missing() -> str:
    """Return what the simulated board lacks on this machine; empty where it can be built."""
    lacks = [tool for tool in ("avr-gcc", "make", "cc") if shutil.which(tool) is None]
    if "avr-gcc" not in lacks and not _has_header("avr-gcc", "stdlib.h"):
        lacks.append("avr-libc")
    if "cc" not in lacks and not _has_header("cc", "simavr/sim_avr.h"):
        lacks.append("libsimavr")
    return f"{', '.join(lacks)} missing; Debian packages: {PACKAGES}" if lacks else ""


@contextmanager
def _alone() -> Iterator[None]:
    """Let no other process build at the same time."""
    BUILD.mkdir(exist_ok=True)
    with (BUILD / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _run(*command: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} failed:\n{done.stdout}{done.stderr}")


@functools.cache
def hex_file() -> Path:
    """Return the firmware as it is flashed."""
    with _alone():
        _run("make", "-C", str(FIRMWARE), f"BOARD={BOARD}")
    return elf_file().with_suffix(".hex")


def elf_file() -> Path:
    """Return where the firmware lies with its symbols."""
    return BUILD / BOARD / "pneumarm.elf"


def hash_of_sources() -> int:
    """Return what a program of these sources calls itself, by the lists in its Makefile."""
    makefile = (FIRMWARE / "Makefile").read_text()
    lists = [line.split(":=")[1].split() for line in makefile.splitlines() if line.startswith(("SOURCES", "HEADERS"))]
    names = [name.replace("$(BOARD)", BOARD) for names in lists for name in names]
    files = [*FIRMWARE.glob("*.[ch]"), *(FIRMWARE / "boards" / BOARD).iterdir()]
    assert set(names) == {path.relative_to(FIRMWARE).as_posix() for path in files}
    digest = hashlib.sha256(b"".join((FIRMWARE / name).read_bytes() for name in [*names, "Makefile"]))
    return int(digest.hexdigest()[:8], 16)


@functools.cache
def symbols() -> dict[str, tuple[int, int]]:
    """Return the address in the data memory and the size of each variable of the firmware; ends have no size."""
    hex_file()
    listing = subprocess.run(
        ["avr-nm", "--print-size", str(elf_file())], capture_output=True, text=True, check=True
    ).stdout
    found = {}
    for line in listing.splitlines():
        address, *size, kind, name = line.split()
        if kind in "bBdD" and int(address, 16) < _EEPROM:
            found[name] = (int(address, 16) - _DATA, int(size[0], 16) if size else 0)
    return found


def _library(source: Path, others: tuple[Path, ...], flags: tuple[str, ...]) -> Path:
    digest = hashlib.sha256(" ".join(flags).encode())
    for path in (source, *others):
        digest.update(path.read_bytes())
    library = BUILD / f"{source.stem}-{digest.hexdigest()[:12]}.so"
    with _alone():
        if not library.exists():
            made = library.with_suffix(".new")  # a compiler that is killed must not leave half a library there
            _run("cc", "-std=gnu11", "-shared", "-fPIC", "-O2", "-o", str(made), str(source), *flags)
            made.rename(library)
    return library


@functools.cache
def shim() -> Path:
    """Return the simulated board as a library."""
    return _library(HERE / "shim.c", (), ("-lsimavr", "-lelf"))


@functools.cache
def decoder() -> Path:
    """Return the firmware's frames, compiled for this machine, as a library."""
    headers = (FIRMWARE / "frame.h", FIRMWARE / "protocol.h")
    return _library(FIRMWARE / "frame.c", headers, ("-Wall", "-Wextra", "-Werror"))
