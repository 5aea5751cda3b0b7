"""The door of the live page: whoever comes asks for something soon or leaves again, so that nobody delays a stop.

Every connection costs a file, and turns of the loop that hears a stop, too. So those that show no page are few: one
more, and the one that was silent for longest is closed. Others wait in the system's queue until they are taken in,
one at a time.
"""

import asyncio
import socket
from collections.abc import Callable
from contextlib import suppress

Peer = tuple[str, int]
"""Address and port of whoever is connected."""
_MOST = 64
"""Connections without a page that may be open at a time: those of ten browsers, each with six for files."""
_SILENT = 5.0
"""After so long [s] without a request a connection is closed; uvicorn does the same after its first."""
_LOOK = 1.0
"""Time between two looks at who is silent [s]."""
_PAUSE = 0.05
"""Time until the next connection is taken in where the system has no file left for it [s]."""


class Door:
    """Takes in connections, and closes those that are silent for too long and show no page."""

    def __init__(self) -> None:
        self._waiting: dict[Peer, tuple[float, asyncio.Transport | None]] = {}
        """Since when they are silent [s], the longest first; without a transport for as long as it is being made."""

    async def open(self, listening: socket.socket, protocol: Callable[[], asyncio.Protocol]) -> None:
        """Take in what comes to the socket ``listening``, each with a ``protocol`` of its own, until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._close_silent())
            await self._accept(listening, protocol)

    async def _accept(self, listening: socket.socket, protocol: Callable[[], asyncio.Protocol]) -> None:
        loop = asyncio.get_running_loop()
        while True:
            try:
                come, address = await loop.sock_accept(listening)
            except OSError:  # no file is left, or whoever came has left
                self._close_longest_silent()
                await asyncio.sleep(_PAUSE)
                continue
            peer = str(address[0]), int(address[1])
            self._waiting[peer] = loop.time(), None
            with suppress(OSError):
                transport, _ = await loop.connect_accepted_socket(protocol, come)
                if peer in self._waiting:
                    self._waiting[peer] = loop.time(), transport
            if len(self._waiting) > _MOST:
                self._close_longest_silent()

    async def _close_silent(self) -> None:
        while True:
            await asyncio.sleep(_LOOK)
            latest = asyncio.get_running_loop().time() - _SILENT
            while self._waiting and next(iter(self._waiting.values()))[0] < latest:
                self._close_longest_silent()

    def hear(self, peer: Peer | None) -> None:
        """Note that ``peer`` has asked for something."""
        if peer in self._waiting:
            _, transport = self._waiting.pop(peer)
            self._waiting[peer] = asyncio.get_running_loop().time(), transport

    def let_in(self, peer: Peer | None) -> None:
        """Leave ``peer`` alone from now on: it shows a page."""
        self._waiting.pop(peer, None)  # type: ignore[arg-type]

    def _close_longest_silent(self) -> None:
        if self._waiting:
            _, transport = self._waiting.pop(next(iter(self._waiting)))
            if transport is not None:
                transport.abort()  # whatever is still to be sent
