"""TrialRows on disk: one JSON object a line, durable as soon as it is appended, never computed twice."""

import os
from pathlib import Path
from types import TracebackType
from typing import Self

import msgspec

from pneumarm.errors import UnusableInput
from pneumarm.experiments.experiment import Row
from pneumarm.files import read_bytes, require_regular_file, writing
from pneumarm.transitions.lock import WriterLock

_LARGEST = 256 << 20  # bytes; a row has some hundred


def read_trial_rows(path: Path) -> list[Row]:
    """Return the rows in ``path``; none where there is no file. A last line cut short by a crash does not count.

    Raises:
        UnusableInput: a line is no row.

    """
    if not path.exists():
        return []
    return _parsed(path, _whole_lines(read_bytes(path, "rows of an experiment", _LARGEST)))


def _whole_lines(content: bytes) -> bytes:
    return content[: content.rfind(b"\n") + 1]


def _parsed(path: Path, content: bytes) -> list[Row]:
    rows = []
    for number, line in enumerate(content.splitlines(), 1):
        try:
            rows.append(msgspec.json.decode(line, type=Row))
        except (msgspec.DecodeError, RecursionError) as error:
            raise UnusableInput(
                f"{path}, line {number}: expected a row of an experiment, {error}; remove it"
            ) from error
    return rows


class RowWriter:
    """The one that appends rows to a file; nobody else may meanwhile."""

    def __init__(self, path: Path) -> None:
        """Take up the file ``path``, or begin it.

        Raises:
            UnusableInput: another process writes to it, or a line is no row.

        """
        self._path, self._lock = path, WriterLock(path)
        try:
            if path.exists():
                require_regular_file(path, "rows of an experiment")
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
            self._file = os.fdopen(descriptor, "r+b")
            whole = _whole_lines(self._file.read())
            self._file.truncate(len(whole))
            self._file.seek(len(whole))
            self.rows = _parsed(path, whole)
            """What was there, and what was appended since."""
        except BaseException:
            self._lock.release()
            raise

    def append(self, row: Row) -> None:
        """Append ``row``; it is on disk when this returns."""
        with writing(self._path):
            self._file.write(msgspec.json.encode(row) + b"\n")
            self._file.flush()
            os.fsync(self._file.fileno())
        self.rows.append(row)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()
        self._lock.release()
