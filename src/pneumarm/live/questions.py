"""A page that tells and asks: what ``pneumarm setup`` shows before there is an arm that can be dragged."""

import json
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from queue import SimpleQueue
from threading import Event, Thread, main_thread
from time import sleep
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from pneumarm.live.server import address_of_page, allowed, bound_to, page_file

_LARGEST = 1000  # bytes of an answer
_KEPT = 200  # lines that were said
_TURN = 0.02  # s between two looks whether it is served
_SHOWN = "setup/shown"
DONE = Response(status_code=204)
REFUSED = Response("open the address that pneumarm has printed, token and all", 403)


class QuestionPage:
    """What is said and asked, and the answers, at ``host`` and ``port``, for whoever knows the ``token``."""

    def __init__(self, host: str, port: int, token: str | None) -> None:
        self.shown: dict[str, Any] = {"said": [], "asked": 0, "question": "", "choices": [], "numbers": False}
        self.shown |= {"bars": [], "doing": None}
        self.answers: SimpleQueue[str] = SimpleQueue()
        self.stopped = Event()
        """Whether somebody pressed stop."""
        self._token, self._socket = token, bound_to(host, port)
        self.port = int(self._socket.getsockname()[1])
        self.url = address_of_page(host, self.port, token)

    def say(self, text: str) -> None:
        """Add a line to what was said."""
        self.shown["said"] = [*self.shown["said"], text][-_KEPT:]

    def ask(self, question: str, choices: list[str], numbers: bool) -> None:
        """Show a question; answers to those before it no longer count."""
        while not self.answers.empty():
            self.answers.get()
        asked = self.shown["asked"] + 1
        self.shown |= {
            "question": question, "choices": choices, "numbers": numbers, "asked": asked, "doing": None,
        }  # fmt: skip

    @contextmanager
    def served(self) -> Iterator[None]:
        """Serve the page from another thread while the block runs; a stop interrupts this one, the main thread."""
        routes = [Route("/setup/{what}", self._post, methods=["POST"]), Route("/{name:path}", self._get)]
        server = uvicorn.Server(uvicorn.Config(Starlette(routes=routes), log_level="error", lifespan="off"))
        serving = Thread(target=server.run, kwargs={"sockets": [self._socket]}, name="setup page", daemon=True)
        serving.start()
        while not server.started and serving.is_alive():
            sleep(_TURN)
        try:
            yield
        finally:
            server.should_exit = True
            serving.join()
            self._socket.close()

    async def _get(self, request: Request) -> Response:
        name = request.path_params["name"]
        if name not in ("", _SHOWN):
            return page_file(name)
        if not allowed(request, self._token):
            return REFUSED
        return Response(json.dumps(self.shown), media_type="application/json") if name else page_file("setup.html")

    async def _post(self, request: Request) -> Response:
        if not allowed(request, self._token):
            return REFUSED
        if request.path_params["what"] == "stop":
            self.stopped.set()
            signal.pthread_kill(main_thread().ident or 0, signal.SIGINT)  # ends waits too
            return DONE
        content = (await anext(request.stream()))[:_LARGEST]
        number, _, answer = content.decode(errors="replace").partition(" ")
        if number == str(self.shown["asked"]) and self.shown["question"]:
            self.shown["question"] = ""
            self.answers.put(answer.strip())
        return DONE
