"""Command lines on damaged files: how they are run, and the rule that all of them must keep."""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from children import LIMIT

SECONDS = 5.0
"""What a command may take [s]."""
DRAWING = ("analyse", "coverage", "report", "run")
DRAWING_SECONDS = 20.0
"""What those may take that draw dozens of figures or fit a simulation, as they do with sound files [s]."""
MEMORY = 600.0
"""What a command may hold [MB]."""
LONGEST_LINE = 500
"""Characters of a line on standard error."""
_LATER = 2.0
"""Times what a command may take: after that it is killed as one that hangs."""
REFUSED, DONE_OR_REFUSED, ANY = (2,), (0, 2), (0, 1, 2)
"""Exit codes: of what cannot be used; of what may be; of what may also move an arm in vain."""
ARM = "virtual:seed=7"


@dataclass(frozen=True)
class Case:
    """A command line, and the damage that is done before it."""

    name: str
    arguments: tuple[str, ...]
    """In a folder of sound files, among which the damaged one is made."""
    damage: Callable[[Path], object] = lambda folder: None
    """Makes it, given the folder."""
    codes: tuple[int, ...] = REFUSED
    """Exit codes that are right."""
    input: bytes = b""


@dataclass(frozen=True)
class Outcome:
    """What came of a command line."""

    code: int
    seconds: float
    cpu: float
    """Time that it computed [s]."""
    memory: float
    """[MB]"""
    output: str
    errors: str


def violations(case: Case, done: Outcome, load: float = 0.0) -> list[str]:
    """Return what of the rule a command broke, given for how many others each core had work meanwhile.

    The rule: a right exit code; one short line on standard error where it is not 0, besides progress; no traceback,
    no bug, no warning of a library; done within seconds and in little memory.
    """
    found, lines = [], [line for line in done.errors.splitlines() if line.strip()]
    complaints = [line for line in lines if line.startswith("pneumarm: ")]
    allowed = DRAWING_SECONDS if case.arguments[0] in DRAWING else SECONDS
    if done.code not in case.codes:
        found.append(f"exit {done.code}")
    if done.code != 0 and (len(complaints) != 1 or lines[-1:] != complaints):
        found.append(f"{len(complaints)} lines of error")
    if done.code == 2 and len(lines) > 3:
        found.append(f"{len(lines)} lines")
    if any(len(line) > LONGEST_LINE for line in lines):
        found.append(f"a line of {max(map(len, lines)):,} characters")
    if match := re.search(r"Traceback|a bug in pneumarm|\w*Warning:", done.errors):
        found.append(repr(match[0]))
    if done.cpu > allowed or done.seconds > allowed * (1 + load):
        found.append(f"{done.seconds:.1f} s, {done.cpu:.1f} of them computing")
    if done.memory > MEMORY:
        found.append(f"{done.memory:.0f} MB")
    return found


class Commands:
    """Runs cases, each in a copy of the folder ``sound``, which no command changes."""

    def __init__(self, server: "subprocess.Popen[str]", sound: Path, place: Path) -> None:
        self._server, self._sound, self._place = server, sound, place
        self.folder = place / "work"

    def ask(self, arguments: tuple[str, ...], **order: Any) -> dict[str, Any]:
        """Have the server do a command line and return its answer."""
        assert self._server.stdin is not None
        assert self._server.stdout is not None
        print(json.dumps({"arguments": arguments, "folder": str(self.folder), **order}), file=self._server.stdin)
        self._server.stdin.flush()
        answer: dict[str, Any] = json.loads(self._server.stdout.readline())
        return answer

    def renew(self) -> None:
        """Make the folder as it was."""
        shutil.rmtree(self.folder, ignore_errors=True)
        shutil.copytree(self._sound, self.folder)

    def outcome(self, case: Case) -> Outcome:
        """Do the damage, run the command, and return what came of it."""
        self.renew()
        case.damage(self.folder)
        files = {name: str(self._place / name) for name in ("input", "output", "errors")}
        Path(files["input"]).write_bytes(case.input)
        allowed = DRAWING_SECONDS if case.arguments[0] in DRAWING else SECONDS
        answer = self.ask(case.arguments, **files, patience=_LATER * allowed * (1 + load()))
        said = (Path(files[name]).read_bytes()[:1_000_000].decode(errors="replace") for name in ("output", "errors"))
        return Outcome(**answer, **dict(zip(("output", "errors"), said, strict=True)))

    def failures(self, case: Case) -> Iterator[str]:
        """Run the case and yield a line if it breaks the rule."""
        before = load()
        done = self.outcome(case)
        if broken := violations(case, done, max(before, load())):
            last = (done.errors.strip().splitlines() or [""])[-1]
            yield f"{case.name}: {', '.join(broken)}: {' '.join(case.arguments)[:120]}: {last[:250]!r}"


def load() -> float:
    """Return how many processes had work for each core in the last minute."""
    return os.getloadavg()[0] / (os.cpu_count() or 1)


@contextmanager
def commands(sound: Path, place: Path, used: Iterable[tuple[str, ...]]) -> Iterator[Commands]:
    """Give what runs cases; it has done the command lines ``used`` before, on sound files, and without an error."""
    command = [sys.executable, str(Path(__file__).with_name("warm.py"))]
    with (
        (place / "server").open("w") as errors,
        subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True, encoding="utf-8"
        ) as server,
    ):
        try:
            found = Commands(server, sound, place)
            for arguments in used:
                found.renew()
                assert found.ask(arguments, here=True)["code"] == 0, (place / "server").read_text()[-1000:]
            yield found
            assert server.stdin is not None
            server.stdin.close()
            server.wait(LIMIT)
        finally:
            server.kill()
