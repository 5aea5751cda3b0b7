"""The connection of a page: who may open it, who may move the arm, and what comes over it."""

import json
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from socket import SHUT_RDWR
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.sync.client import ClientConnection, connect

from children import wait_until
from live.serving import ARM, served
from pneumarm.errors import UnusableInput
from pneumarm.live.live_arm import LiveArm
from pneumarm.live.server import MOST_PAGES, LiveServer
from pneumarm.run import RunSettings


def joined(server: LiveServer, query: str = "", **options: Any) -> ClientConnection:
    """Return a connection as a page opens it."""
    return connect(server.url.replace("http", "ws").partition("?")[0] + "connection" + query, **options)


def order(connection: ClientConnection, do: str, **values: Any) -> None:
    connection.send(json.dumps({"do": do, **values}))


def told(connection: ClientConnection, kind: str, is_it: Callable[[Any], bool] = lambda message: True) -> Any:
    """Return the next message of a ``kind`` that ``is_it``."""
    found: list[Any] = []

    def came() -> bool:
        message = json.loads(connection.recv(timeout=60))
        found.append(message.get(kind))
        return kind in message and is_it(message[kind])

    wait_until(f"a message of kind {kind}", came)
    return found[-1]


def status(url: str, **headers: str) -> int:
    try:
        with urlopen(Request(url, headers=headers), timeout=30) as answer:
            return int(answer.status)
    except HTTPError as error:
        return error.code


def test_one_page_moves_the_arm_and_the_others_watch(server: LiveServer) -> None:
    with joined(server) as first, joined(server) as second:
        order(first, "take")
        mine = told(first, "state", lambda state: state["writer"] == state["you"])
        assert (mine["joints"], mine["mode"], mine["to_scale"]) == (1, "relaxed", True)
        order(second, "goal", degrees=[10])
        assert "ask for control" in told(second, "refused")
        order(first, "goal", degrees=[10])
        told(second, "frame", lambda frame: frame["goal"] == [10] and abs(frame["angle"][0] - 10) < 2)
        order(second, "take")
        told(first, "state", lambda state: state["asking"] is not None)
        order(first, "hand-over")
        told(second, "state", lambda state: state["writer"] == state["you"])
        order(first, "stop")  # whoever looks on may
        told(second, "state", lambda state: state["mode"] == "stopped")


def test_ten_go_on_watching_when_the_page_that_moves_the_arm_is_killed(server: LiveServer) -> None:
    with ExitStack() as stack:
        writer = stack.enter_context(joined(server))
        watchers = [stack.enter_context(joined(server)) for _ in range(10)]
        order(writer, "take")
        told(writer, "state", lambda state: state["writer"] == state["you"])
        order(writer, "goal", degrees=[20])
        told(watchers[-1], "frame", lambda frame: abs(frame["angle"][0] - 20) < 2)
        writer.socket.shutdown(SHUT_RDWR)  # nothing is said any more, not even that it ends
        for watcher in watchers:
            told(watcher, "state", lambda state: state["writer"] is None and state["pages"] == 10)
        told(watchers[0], "state", lambda state: state["mode"] == "relaxed" and "gone" in state["why"])
        order(watchers[3], "take")
        order(watchers[3], "goal", degrees=[-10])
        told(watchers[0], "frame", lambda frame: abs(frame["angle"][0] + 10) < 2)


def test_nonsense_is_refused_and_harms_nobody(server: LiveServer) -> None:
    with joined(server) as page:
        for text in ("", "{}", "[" * 10_000, '{"do": "goal", "degrees": []}'):
            page.send(text)
            assert told(page, "refused")
        page.send("x" * (1 << 20))
        with pytest.raises(ConnectionClosed):
            told(page, "refused")  # nobody has read so much
    with joined(server) as page:
        assert told(page, "frame")["pressure"]


def test_only_this_machine_and_this_page_may_come_without_a_token(server: LiveServer) -> None:
    assert status(server.url) == 200
    assert status(server.url + "uplot/LICENSE") == 200
    assert status(server.url + "../pyproject.toml") == 404
    assert status(server.url, Host="elsewhere.org") == 403
    with joined(server, origin="http://elsewhere.org") as page, pytest.raises(ConnectionClosed):  # type: ignore[arg-type]
        page.recv(timeout=60)


def test_with_a_token_nobody_comes_without_it(pid: Path) -> None:
    with served(LiveArm(RunSettings(arm=ARM), [str(pid)], None), "secret") as server:
        assert server.url.endswith("/?token=secret")
        assert status(server.url) == 200
        for guess in ("guess", "", "s", "secre", "secrets", "Secret", "secret%00"):
            assert status(server.url.replace("secret", guess)) == 403
        assert status(server.url.partition("?")[0]) == 403
        with joined(server) as page, pytest.raises(ConnectionClosed):
            page.recv(timeout=60)
        with joined(server, "?token=secret") as page:
            assert told(page, "frame")


def test_only_so_many_pages_are_open_at_a_time(server: LiveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    assert MOST_PAGES == 50
    monkeypatch.setattr("pneumarm.live.server.MOST_PAGES", 3)
    with ExitStack() as stack:
        pages = [stack.enter_context(joined(server)) for _ in range(3)]
        for page in pages:
            told(page, "state", lambda state: state["pages"] == 3)
        with pytest.raises((ConnectionClosed, InvalidHandshake)), joined(server) as one_more:
            one_more.recv(timeout=60)
        pages[0].close()
        told(pages[1], "state", lambda state: state["pages"] == 2)
        with joined(server) as page:
            assert told(page, "frame")


def test_a_port_that_is_taken_is_said(server: LiveServer) -> None:
    port = int(server.url.rstrip("/").rpartition(":")[2])
    with pytest.raises(UnusableInput, match="another --host or --port"):
        LiveServer(server.live_arm, "127.0.0.1", port, None)


def test_hosts_and_tokens_of_any_letters_are_answered(pid: Path) -> None:
    with served(LiveArm(RunSettings(arm=ARM), [str(pid)], None)) as server:
        address = server.url
        assert status(address) == 200
        assert [status(address, Host=host) for host in ("[", "[::1", "[]:80", "\xe4")] == [403] * 4
        assert status(address, Origin="http://[") == 403
        server.token = "schlüssel &?"
        assert status(server.url) == 200
        assert [status(f"{address}?token={token}") for token in ("schl", "%C3%BC", "%FF")] == [403] * 3
