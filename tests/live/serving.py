"""The live page of an arm, served within a test."""

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Thread

from children import wait_until
from pneumarm.live.rig import Rig
from pneumarm.live.server import LiveServer

ARM = "virtual:seed=3"


@contextmanager
def served(rig: Rig, token: str | None = None) -> Iterator[LiveServer]:
    """Serve ``rig`` on a free port while the block runs."""
    server = LiveServer(rig, "127.0.0.1", 0, token)
    opened: list[bool] = []
    with rig:
        thread = Thread(target=lambda: server.run(lambda: opened.append(True)), daemon=True)
        thread.start()
        wait_until("the page can be opened", lambda: bool(opened))
        try:
            yield server
        finally:
            server.end()
            thread.join(timeout=30)
