"""The page and its connection: what is shown goes out, orders come in.

Bound to this machine the page needs no token; elsewhere it does, and so does everything that moves the arm. A page of
another origin is refused in both cases: a foreign site in the same browser must not move an arm.
"""

import asyncio
import hmac
import json
import socket
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import cache, partial
from importlib.resources import files
from types import FrameType
from urllib.parse import quote, urlsplit

import uvicorn
from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.responses import Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.live.door import Door
from pneumarm.live.live_arm import LiveArm
from pneumarm.live.orders import LARGEST, AnyOrder, Choose, PutBack, read_order

MOST_PAGES = 50
"""Pages that may be open at a time."""
_LOOK = 0.012
"""Time between two looks at the screen, for a page [s]."""
_LOCAL = ("127.0.0.1", "localhost", "::1")
_TYPES = {"html": "text/html", "css": "text/css", "js": "text/javascript", "svg": "image/svg+xml"}
_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; style-src 'self' 'unsafe-inline'; frame-ancestors 'none'",
    "Cache-Control": "no-cache",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
_QUEUE = 128  # of connections that the system keeps until they are taken in
_REFUSED, _FULL = 4403, 4429  # codes that a refused connection is closed with


class LiveServer:
    """Serves ``live_arm`` on ``host`` and ``port``; 0 takes any port that is free.

    Raises:
        UnusableInput: the host is none of this machine, or the port is taken.

    """

    def __init__(self, live_arm: LiveArm, host: str, port: int, token: str | None) -> None:
        self.live_arm, self.token = live_arm, token
        self._host = host
        self._socket = bound_to(host, port)
        self._port = int(self._socket.getsockname()[1])
        self._serving: _Uvicorn | None = None
        self._door = Door()

    @property
    def url(self) -> str:
        """Where the page is."""
        return address_of_page(self._host, self._port, self.token)

    def run(self, opened: Callable[[], None] = lambda: None) -> None:
        """Serve until the program, or :meth:`end`, asks for the end; ``opened`` is called once it can be reached."""
        app = Starlette(
            routes=[
                WebSocketRoute("/connection", self._connection),
                Route("/", self._page),
                Route("/{name:path}", self._file),
            ]
        )
        config = uvicorn.Config(
            app,
            log_level="error",  # not a line for everything that is no request
            ws="websockets-sansio",
            ws_max_size=LARGEST,
            ws_ping_interval=5.0,
            ws_ping_timeout=10.0,
            timeout_graceful_shutdown=1,
            lifespan="off",
            proxy_headers=False,  # the door knows a connection by the address that it comes from
        )
        self._serving = serving = _Uvicorn(config, self.live_arm, self._door, self._socket, opened)
        with _closing(self._socket):
            try:
                asyncio.get_running_loop()
            except RuntimeError:
                serving.run(sockets=[])
                return
            with ThreadPoolExecutor(1) as beside:  # a notebook has a loop of its own in this thread
                served = beside.submit(serving.run, sockets=[])
                try:
                    served.result()
                except BaseException:
                    self.end()
                    raise

    def end(self) -> None:
        """Have the arm vented and the serving ended, from another thread."""
        self.live_arm.leave()
        if self._serving is not None:
            self._serving.should_exit = True

    def _allowed(self, connection: HTTPConnection) -> bool:
        return allowed(connection, self.token)

    async def _page(self, request: Request) -> Response:
        self._door.hear(request.client)
        if not self._allowed(request):
            return Response("open the address that pneumarm has printed, token and all", 403)
        return page_file("index.html")

    async def _file(self, request: Request) -> Response:
        self._door.hear(request.client)
        return page_file(request.path_params["name"])

    async def _connection(self, socket: WebSocket) -> None:
        await socket.accept()
        if not self._allowed(socket):
            await socket.close(_REFUSED)
            return
        lease = self.live_arm.lease
        if len(lease.pages) >= MOST_PAGES:
            await socket.close(_FULL)
            return
        self._door.let_in(socket.client)
        page = lease.enter()
        showing = asyncio.create_task(self._show(socket, page))
        try:
            await self._listen(socket, page)
        finally:
            lease.leave(page)
            showing.cancel()

    async def _show(self, socket: WebSocket, page: int) -> None:
        """Send what changes. A page that is slow misses frames; nothing piles up."""
        screen, lease, frames = self.live_arm.screen, self.live_arm.lease, -1
        told: tuple[int | None, ...] = ()
        with suppress(WebSocketDisconnect, RuntimeError):
            while True:
                now = screen.versions, lease.writer, lease.asking, len(lease.pages)
                if now != told:
                    told = now
                    await socket.send_text(json.dumps({"state": self.live_arm.told_to(page)}))
                if screen.frames != frames:
                    frames = screen.frames
                    await socket.send_text(f'{{"frame": {screen.frame}}}')
                await asyncio.sleep(_LOOK)

    async def _listen(self, socket: WebSocket, page: int) -> None:
        doing: set[asyncio.Task[None]] = set()
        try:
            while True:
                text = await socket.receive_text()
                try:
                    order = read_order(text, self.live_arm.screen.state["joints"])
                    if isinstance(order, Choose | PutBack):  # which take a while
                        task = asyncio.create_task(self._do(socket, page, order))
                        doing.add(task)
                        task.add_done_callback(doing.discard)
                    else:
                        self.live_arm.order(page, order)
                except UnusableInput as error:
                    await socket.send_text(json.dumps({"refused": str(error)}))
        except (WebSocketDisconnect, RuntimeError, KeyError):
            return

    async def _do(self, socket: WebSocket, page: int, order: AnyOrder) -> None:
        try:
            await asyncio.to_thread(self.live_arm.order, page, order)
        except PneumarmError as error:
            with suppress(WebSocketDisconnect, RuntimeError):
                await socket.send_text(json.dumps({"refused": str(error)}))


class _Uvicorn(uvicorn.Server):
    """Says when it can be reached, and has the arm vented before anything else when it is to end."""

    def __init__(
        self,
        config: uvicorn.Config,
        live_arm: LiveArm,
        door: Door,
        listening: socket.socket,
        opened: Callable[[], None],
    ) -> None:
        super().__init__(config)
        self._live_arm, self._door, self._listening, self._opened = live_arm, door, listening, opened

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin to serve what comes through the door."""
        await super().startup(sockets)
        self._listening.listen(_QUEUE)
        self._listening.setblocking(False)
        kind = self.config.http_protocol_class
        given = {"config": self.config, "server_state": self.server_state, "app_state": self.lifespan.state}
        self._task = asyncio.create_task(self._door.open(self._listening, partial(kind, **given)))
        self._opened()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Take in nobody more, and end."""
        self._task.cancel()
        await super().shutdown(sockets)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Take a signal to end."""
        self._live_arm.leave()
        super().handle_exit(sig, frame)


def allowed(connection: HTTPConnection, token: str | None) -> bool:
    """Return whether who asks knows the ``token``, or comes from this machine where there is none."""
    host = connection.headers.get("host", "")
    origin = connection.headers.get("origin")
    try:
        local = urlsplit(f"//{host}").hostname in _LOCAL
        foreign = origin is not None and urlsplit(origin).netloc != host
    except ValueError:  # no address of a host
        return False
    if foreign or token is None:
        return local and not foreign
    given = connection.query_params.get("token", "")
    return hmac.compare_digest(*(one.encode(errors="surrogateescape") for one in (given, token)))


def address_of_page(host: str, port: int, token: str | None) -> str:
    """Return where a page is that is served at ``host`` and ``port``."""
    host = _own_address() if host in ("0.0.0.0", "::") else host
    host = f"[{host}]" if ":" in host else host
    query = f"?token={quote(token, '', errors='surrogateescape')}" if token else ""
    return f"http://{host}:{port}/{query}"


def page_file(name: str) -> Response:
    """Return the file of the page called ``name``."""
    content = _page_files().get(name)
    if content is None:
        return Response("not found", 404)
    return Response(content, media_type=_TYPES.get(name.rpartition(".")[2], "text/plain"), headers=_HEADERS)


@cache
def _page_files() -> dict[str, bytes]:
    """Return the files of the page, by their address."""
    found: dict[str, bytes] = {}
    page = files("pneumarm.live") / "page"
    for place in page.iterdir():
        if place.is_dir():
            found |= {f"{place.name}/{one.name}": one.read_bytes() for one in place.iterdir()}
        else:
            found[place.name] = place.read_bytes()
    return found


def bound_to(host: str, port: int) -> socket.socket:
    """Return a socket at ``host`` and ``port``; UnusableInput where there is none."""
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        bound = socket.socket(family, socket.SOCK_STREAM)
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind((host, port))
    except (OSError, OverflowError) as error:
        raise UnusableInput(
            f"the page cannot be served at {host}:{port} ({getattr(error, 'strerror', None) or error}); give another "
            "--host or --port"
        ) from error
    return bound


def _own_address() -> str:
    """Return the address at which others reach this machine; its name where it is in no network."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking, suppress(OSError):
        asking.connect(("192.0.2.1", 9))  # sends nothing; the address is one that nobody has (RFC 5737)
        return str(asking.getsockname()[0])
    return socket.gethostname()


@contextmanager
def _closing(bound: socket.socket) -> Iterator[None]:
    try:
        yield
    finally:
        bound.close()
