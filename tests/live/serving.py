"""The live page of an arm, served within a test."""

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Thread

from children import wait_until
from pneumarm.live.live_arm import LiveArm
from pneumarm.live.server import LiveServer

ARM = "virtual:seed=3"


@contextmanager
def served(live_arm: LiveArm, token: str | None = None) -> Iterator[LiveServer]:
    """Serve ``live_arm`` on a free port while the block runs."""
    server = LiveServer(live_arm, "127.0.0.1", 0, token)
    opened: list[bool] = []
    with live_arm:
        thread = Thread(target=lambda: server.run(lambda: opened.append(True)), daemon=True)
        thread.start()
        wait_until("the page can be opened", lambda: bool(opened))
        try:
            yield server
        finally:
            server.end()
            thread.join(timeout=30)
