"""One writer a store: a lock that the operating system lets go of when its holder dies."""

import os
import socket
import stat
from contextlib import suppress
from pathlib import Path

from filelock import lock_descriptor

from pneumarm.errors import UnusableInput
from pneumarm.files import refuse_link, writing

_IF_KNOWN = ("O_CLOEXEC", "O_NOINHERIT", "O_NOFOLLOW")
_HOW = os.O_RDWR | os.O_CREAT | sum(getattr(os, name, 0) for name in _IF_KNOWN)


class WriterLock:
    """An exclusive lock on a file next to a store, which says who holds it.

    The lock is not taken on the store itself, because closing any descriptor of a file also lets go of the locks
    that SQLite holds on it.
    """

    def __init__(self, store: Path) -> None:
        """Take the lock of ``store``.

        Raises:
            UnusableInput: another writer holds it, or the folder cannot be written.

        """
        self._path = store.with_name(store.name + "-writer")
        while True:
            refuse_link(self._path)
            try:
                self._file = os.open(self._path, _HOW, 0o644)
            except OSError as error:
                raise UnusableInput(f"{store}: cannot be written ({error.strerror})") from error
            found = os.fstat(self._file)
            if not stat.S_ISREG(found.st_mode) or found.st_nlink > 1:  # it is another file, too, and is to be emptied
                os.close(self._file)
                raise UnusableInput(f"{self._path}: is not a file of pneumarm's; remove it")
            if not lock_descriptor(self._file, blocking=False):
                holder = self._holder()
                os.close(self._file)
                raise UnusableInput(f"{store}: {holder} is writing to it; wait for it or stop it first")
            if self._is_current():
                break
            os.close(self._file)  # the holder before us removed it between our opening and our locking
        with writing(self._path):
            os.ftruncate(self._file, 0)
            os.write(self._file, f" process {os.getpid()} on {socket.gethostname()}".encode())

    def _holder(self) -> str:
        """Return who holds the lock; where locks are of bytes, as on Windows, the first one cannot be read."""
        os.lseek(self._file, 1, os.SEEK_SET)
        return os.read(self._file, 200).decode(errors="replace").strip() or "another process"

    def _is_current(self) -> bool:
        try:
            return os.path.samestat(os.fstat(self._file), os.stat(self._path))
        except FileNotFoundError:
            return False

    def release(self) -> None:
        """Let go of the lock. May be called twice."""
        if self._file >= 0:
            if os.name == "nt":  # where nobody can remove a file that is open
                os.close(self._file)
                with suppress(OSError):  # the next holder has it by now
                    self._path.unlink(missing_ok=True)
            else:  # nor may the next holder have it open when it is removed
                self._path.unlink(missing_ok=True)
                os.close(self._file)
            self._file = -1
