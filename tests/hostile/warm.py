"""Runs command lines, each in a fork of this process, which has loaded what they need: most then take no second.

A line on standard input is a JSON object with ``arguments``, ``folder``, ``input`` (a file), ``output`` and
``errors`` (files to write) and ``patience`` [s]; the answer on standard output is one with ``code``, ``seconds``,
``cpu`` [s] and ``memory`` [MB]. With ``here`` the command line is run in this process itself, so that forks find its
kernels loaded.
"""

import importlib
import json
import os
import pkgutil
import resource
import signal
import sys
import threading
import traceback
from contextlib import suppress
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import pneumarm.commands
from pneumarm.cli import main

MORE = 2 << 30
"""Address space that a command gets besides this process' [bytes]: what needs more fails; others go on."""
LONGEST_FILE = 1 << 30
"""What a command may write into one file [bytes]."""
_LOOK = 0.005
"""Time between two looks whether a command has ended [s]."""


def status_of(arguments: list[str]) -> int:
    """Return the exit status of a command line, as the interpreter would give it."""
    try:
        main(arguments)
    except SystemExit as left:
        return left.code if isinstance(left.code, int) else left.code is not None
    except BaseException:
        traceback.print_exc()
        return 1
    return 0


def become(order: dict[str, Any]) -> None:
    """Run the command line in this process, which ends with it."""
    os.setsid()
    os.chdir(order["folder"])
    writing = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
    for place, (name, flags) in enumerate(
        (("input", os.O_RDONLY), ("output", writing), ("errors", writing | os.O_APPEND))
    ):
        os.dup2(os.open(order[name], flags, 0o600), place)
    most = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize() + MORE
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_FSIZE, (LONGEST_FILE, LONGEST_FILE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    sys.stdin, sys.stdout, sys.stderr = os.fdopen(0), os.fdopen(1, "w"), os.fdopen(2, "w", buffering=1)
    code = status_of(order["arguments"])
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


def run(order: dict[str, Any]) -> dict[str, Any]:
    """Run the command line in a fork and return what came of it; what it started ends with it."""
    begun, child = monotonic(), os.fork()
    if child == 0:
        become(order)
    while not (ended := os.wait4(child, os.WNOHANG))[0]:
        if monotonic() - begun > order["patience"]:
            os.kill(child, signal.SIGKILL)
        sleep(_LOOK)
    seconds = monotonic() - begun
    with suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    _, status, usage = ended
    return {
        "code": os.waitstatus_to_exitcode(status),
        "seconds": seconds,
        "cpu": usage.ru_utime + usage.ru_stime,
        "memory": usage.ru_maxrss / 1024,
    }


def serve() -> None:
    """Load every command, then do as is asked until standard input ends."""
    for module in pkgutil.iter_modules(pneumarm.commands.__path__):
        importlib.import_module(f"pneumarm.commands.{module.name}")
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        order = json.loads(line)
        if order.get("here"):
            os.chdir(order["folder"])
            answer: dict[str, Any] = {"code": status_of(order["arguments"])}
            while threading.active_count() > 1:  # a fork has none of them, but their locks
                sleep(_LOOK)
        else:
            answer = run(order)
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    serve()
