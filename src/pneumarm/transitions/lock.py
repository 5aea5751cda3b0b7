"""One writer a store: a lock that the operating system lets go of when its holder dies."""

import fcntl
import os
import socket
from pathlib import Path

from pneumarm.errors import UnusableInput


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
            try:
                self._file = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
            except OSError as error:
                raise UnusableInput(f"{store}: cannot be written ({error.strerror})") from error
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                holder = os.read(self._file, 200).decode(errors="replace").strip() or "another process"
                os.close(self._file)
                raise UnusableInput(f"{store}: {holder} is writing to it; wait for it or stop it first") from error
            if self._is_current():
                break
            os.close(self._file)  # the holder before us removed it between our opening and our locking
        os.ftruncate(self._file, 0)
        os.write(self._file, f"process {os.getpid()} on {socket.gethostname()}".encode())

    def _is_current(self) -> bool:
        try:
            return os.path.samestat(os.fstat(self._file), os.stat(self._path))
        except FileNotFoundError:
            return False

    def release(self) -> None:
        """Let go of the lock. May be called twice."""
        if self._file >= 0:
            self._path.unlink(missing_ok=True)
            os.close(self._file)
            self._file = -1
