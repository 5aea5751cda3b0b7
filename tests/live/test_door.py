"""The door of the live page: idle connections cost nobody a stop, a page or a line on the terminal."""

import asyncio
import os
import socket
from collections.abc import Awaitable, Callable, Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from time import monotonic
from typing import Any

import pytest

from children import wait_until
from live.test_server import joined, order, status, told
from pneumarm.live import door as door_module
from pneumarm.live.door import Door
from pneumarm.live.server import LiveServer

MANY = 150


@contextmanager
def idle(port: int, count: int) -> Iterator[list[socket.socket]]:
    """Give ``count`` connections that say nothing, or as many as the system takes, while the block runs."""
    with ExitStack() as stack:
        yield [connected(stack, port) for _ in range(count)]


def connected(stack: ExitStack, port: int) -> socket.socket:
    one = stack.enter_context(closing(socket.socket()))
    one.setblocking(False)
    with suppress(BlockingIOError):
        one.connect(("127.0.0.1", port))
    return one


def is_closed(one: socket.socket) -> bool:
    try:
        return one.recv(1) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


def port_of(server: LiveServer) -> int:
    return int(server.url.split(":")[2].partition("/")[0])


def test_idle_connections_delay_no_stop_and_no_page(server: LiveServer, capfd: pytest.CaptureFixture[str]) -> None:
    with joined(server) as page, idle(port_of(server), MANY) as others:
        wait_until("most are closed again", lambda: sum(map(is_closed, others)) >= MANY - door_module._MOST)
        assert status(server.url) == 200
        with joined(server):
            order(page, "take")
            begun = monotonic()
            order(page, "stop")
            told(page, "state", lambda state: state["mode"] == "stopped")
            assert monotonic() - begun < 2  # it is 0.05 s; this much on a machine with much else to do
    assert capfd.readouterr().err == ""


def test_who_is_silent_is_closed_and_a_page_is_not(server: LiveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(door_module, "_SILENT", 0.2)
    with joined(server) as page, idle(port_of(server), 3) as others:
        wait_until("all are closed", lambda: all(map(is_closed, others)))
        told(page, "state", lambda state: state["pages"] == 1)
        order(page, "take")
        told(page, "state", lambda state: state["writer"] == state["you"])


class Noted(asyncio.Protocol):
    """Answers each request with a letter, and tells the door that it came."""

    def __init__(self, door: Door) -> None:
        self.door = door

    def connection_made(self, transport: Any) -> None:
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        peer = self.transport.get_extra_info("peername")
        (self.door.let_in if data == b"page" else self.door.hear)(peer)
        self.transport.write(b"!")


def behind_a_door(attack: Callable[[int], Awaitable[None]]) -> list[str]:
    """Have ``attack`` be made on a door's port; return what the loop complained of."""
    complaints: list[str] = []

    async def main() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: complaints.append(str(context)))
        door = Door()
        with closing(socket.create_server(("127.0.0.1", 0), backlog=100)) as listening:
            listening.setblocking(False)
            task = asyncio.create_task(door.open(listening, lambda: Noted(door)))
            await asyncio.wait_for(attack(listening.getsockname()[1]), 60)
            task.cancel()

    asyncio.run(main())
    return complaints


async def asked(one: socket.socket, words: bytes = b"request") -> bytes:
    loop = asyncio.get_running_loop()
    await loop.sock_sendall(one, words)
    return await loop.sock_recv(one, 1)


async def until(is_so: Callable[[], bool]) -> None:
    while not is_so():
        await asyncio.sleep(0.01)


def test_the_one_that_was_silent_for_longest_goes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(door_module, "_MOST", 3)

    async def attack(port: int) -> None:
        with ExitStack() as stack:
            page, heard, silent = (connected(stack, port) for _ in range(3))
            assert await asked(page, b"page") == b"!"
            assert await asked(heard) == b"!"
            assert await asked(silent) == b"!"
            assert await asked(heard) == b"!"
            another = [connected(stack, port) for _ in range(2)]
            await until(lambda: is_closed(silent))
            assert await asked(heard) == b"!"
            another += [connected(stack, port) for _ in range(5)]
            await until(lambda: sum(map(is_closed, another)) == 4)
            assert await asked(page) == b"!"

    assert behind_a_door(attack) == []


def test_without_a_file_left_it_waits_and_says_nothing() -> None:
    resource = pytest.importorskip("resource")

    async def attack(port: int) -> None:
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        with ExitStack() as stack:
            many = [connected(stack, port) for _ in range(40)]
            lowest = os.dup(0)
            os.close(lowest)
            resource.setrlimit(resource.RLIMIT_NOFILE, (lowest + 5, hard))
            stack.callback(resource.setrlimit, resource.RLIMIT_NOFILE, (soft, hard))
            await until(lambda: sum(map(is_closed, many)) > 5)
            assert await asked(many[-1]) == b"!"

    assert behind_a_door(attack) == []
