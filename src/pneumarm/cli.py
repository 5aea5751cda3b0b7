"""The command line. Commands are loaded when they are called, so that ``pneumarm --help`` answers at once."""

import errno
import inspect
import os
import signal
import sys
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any

from cyclopts import App, CycloptsError, Group, Parameter, UnusedCliTokensError

from pneumarm.commands.config_file import take_config, take_option
from pneumarm.commands.help_pages import HELP, HELP_ALL, LOG, AllOptions, FewOptions
from pneumarm.console import complain, open_closed_streams
from pneumarm.errors import PneumarmError
from pneumarm.leaving import signals_as_exceptions
from pneumarm.progress import LEVELS, checked_level, print_lines
from pneumarm.version import __version__

COMMANDS = {
    "run": (
        "Do the whole job: collect, fit, train, test, transfer, report. Resumable.",
        "pneumarm run --arm virtual:seed=7 --out runs/seven --transitions 20000",
    ),
    "setup": (
        "Guide you through an arm's first day: board, valves, sensors, calibration, learning.",
        "pneumarm setup serial:/dev/ttyACM0",
    ),
    "collect": (
        "Make an arm move about and record it.",
        "pneumarm collect virtual arm.db --transitions 20000",
    ),
    "import": (
        "Import a recording made elsewhere.",
        "pneumarm import recording.csv arm.db --mapping examples/recordings/mpi_pam.toml",
    ),
    "export": (
        "Export a recording (CSV, Parquet, LeRobot, Minari) or an agent (ONNX, C).",
        "pneumarm export arm.agent --out agent.c",
    ),
    "deploy": (
        "Build a program by which a board moves its arm with an agent, without a computer.",
        "pneumarm deploy arm.agent --board uno --out build",
    ),
    "copy": (
        "Copy a store to another place: from a file to a server, or back.",
        "pneumarm copy arm.db postgresql://lab@server/rig1",
    ),
    "coverage": (
        "Say how much of the state space a store covers, and whether that is enough.",
        "pneumarm coverage arm.db",
    ),
    "fit": (
        "Fit a simulation to a store.",
        "pneumarm fit arm.db --out arm.sim --history 3 --hidden 10",
    ),
    "analyse": (
        "Draw how good a simulation is.",
        "pneumarm analyse arm.db arm.sim --out quality",
    ),
    "train": (
        "Train an agent in a simulation.",
        "pneumarm train arm.sim arm.db --out arm.agent --method sarsa --agents 16",
    ),
    "test": (
        "Test an agent in a simulation.",
        "pneumarm test arm.agent arm.sim arm.db --episodes 10000",
    ),
    "transfer": (
        "Move an agent onto an arm and let it adapt there.",
        "pneumarm transfer arm.agent --arm virtual:seed=7 --episodes 500 --out adapted",
    ),
    "move": (
        "Move an arm to goals and hold them.",
        "pneumarm move arm.agent --arm virtual:seed=7 20deg -5deg",
    ),
    "track": (
        "Have an arm follow a reference.",
        "pneumarm track arm.pid --arm virtual:seed=7 --reference sine:0.5Hz,20deg",
    ),
    "live": (
        "Show an arm in the browser, moving; drag its goal, draw a movement, stop it.",
        "pneumarm live arm.agent --arm virtual:seed=7",
    ),
    "view": (
        "Make a picture or a film of how an arm moved.",
        "pneumarm view moves.db --out moves.gif",
    ),
    "tune": (
        "Tune a classical controller on an arm: pid, scheduled, pwm or sliding.",
        "pneumarm tune pid --arm virtual:seed=7 --out arm.pid",
    ),
    "versions": (
        "List the versions of an agent that adapted on an arm, and put one back.",
        "pneumarm versions adapted --to 1",
    ),
    "bound": (
        "Say what is possible on a virtual arm, by planning with its true physics.",
        "pneumarm bound --arm virtual:seed=7 --episodes 500",
    ),
    "arm check": (
        "Move an arm gently and say in plain words what is wrong with it.",
        "pneumarm arm check virtual:seed=7 --out checkup",
    ),
    "arm calibrate": (
        "Measure what an arm's counts mean and what it does while it is sound; write arm.toml.",
        "pneumarm arm calibrate virtual:seed=7 --out arm.toml",
    ),
    "arm sensors": (
        "Show the sensors' readings, with all valves closed.",
        "pneumarm arm sensors virtual --seconds 2",
    ),
    "arm errors": (
        "Show what the errors of the thesis' appendix A look like, on one page.",
        "pneumarm arm errors --out errors.html --transitions 4000",
    ),
    "arm valves": (
        "Click every valve, one by one, and name it; before the air is on.",
        "pneumarm arm valves virtual",
    ),
    "arm emulate": (
        "Serve a virtual arm behind an emulated microcontroller and serial port, in real time.",
        "pneumarm arm emulate virtual:seed=7 --link arm.port",
    ),
    "arm flash": (
        "Write the firmware that came with this pneumarm onto a board.",
        "pneumarm arm flash /dev/ttyACM0",
    ),
    "taguchi analyse": (
        "Analyse a table of trials and runs by the design of its experiment.",
        "pneumarm taguchi analyse results.csv --goal larger --design design.toml --out analysis",
    ),
    "experiment": (
        "Repeat an experiment of the thesis.",
        "pneumarm experiment all-goals --out laboratory --runs 8",
    ),
    "claims": (
        "Say which of the thesis' conclusions hold, from the experiments done so far.",
        "pneumarm claims --out laboratory",
    ),
    "report": (
        "Rewrite the report of a finished run.",
        "pneumarm report runs/first",
    ),
    "completion": (
        "Complete commands and options in your shell: bash, zsh or fish.",
        "pneumarm completion bash --install",
    ),
}
"""Every command with its one-line help and an example."""

PANELS = {
    "Begin here": ("run", "live", "setup", "move", "track", "view"),
    "Step by step": ("collect", "coverage", "fit", "analyse", "train", "test", "transfer", "versions", "report"),
    "The arm, and other controllers": ("arm", "tune", "bound"),
    "To other programs and places": ("import", "export", "deploy", "copy"),
    "The thesis' experiments": ("experiment", "claims", "taguchi"),
    "This program": ("completion", "--help", "--version"),
}
"""Where commands are found in the help, in this order."""

MOVING = (
    "run", "collect", "transfer", "move", "track", "live", "tune", "setup",
    "arm check", "arm calibrate", "arm sensors", "arm valves",
)  # fmt: skip
"""Commands that leave an arm, which may be anybody's, closed."""
RESUMED = ("run", "collect", "transfer", "setup", "experiment")
"""Commands that go on, when they are called again, where they were interrupted."""

_NO_BUG = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES, errno.EPERM, errno.EIO)
"""Errors of the operating system that are no bug: full, read-only or broken disks, and what is not allowed."""
_NO_NAME = (errno.ENAMETOOLONG, errno.ELOOP, errno.ENOTDIR, errno.EISDIR)
"""... and names that no file, or no folder, can have or has."""

app = App(
    name="pneumarm",
    help="Learn to control an arm moved by pneumatic muscles and on/off valves, from its own recordings.",
    version=__version__,
    suppress_keyboard_interrupt=False,
    help_formatter=FewOptions(),
    help_epilogue="Try: pneumarm live, which shows a virtual arm in the browser and has it learn, or pneumarm run.",
    default_parameter=Parameter(negative_iterable=()),
)
_places: dict[str, dict[str, Any]] = {
    name: {"group": group, "sort_key": order}
    for group, names in ((Group(title, sort_key=place), PANELS[title]) for place, title in enumerate(PANELS))
    for order, name in enumerate(names)
}
_groups = {
    "arm": App(
        name="arm",
        help="Check an arm, calibrate it, try its valves; emulate one, flash its board.",
        help_epilogue="Begin with: pneumarm arm check ARM.",
        **_places["arm"],
    ),
    "taguchi": App(
        name="taguchi",
        help="Analyse tables of trials and runs by the design of their experiment.",
        help_epilogue="",
        **_places["taguchi"],
    ),
}
for _group in _groups.values():
    app.command(_group)
_USAGE = {
    "move": "Usage: pneumarm move CONTROLLER --arm ARM [OPTIONS] GOALS...",
    "setup": "Usage: pneumarm setup [ARM] [OPTIONS]",
    "live": "Usage: pneumarm live [CONTROLLERS...] [OPTIONS]",
}
"""Usage of commands that take any number of words."""
for _name, (_help, _example) in COMMANDS.items():
    _file, _, _part = _name.partition(" ")
    _groups.get(_file, app).command(
        f"pneumarm.commands.{_file}_:{_part or _file}_",
        name=_part or _file,
        help=_help,
        help_epilogue=f"Example: {_example}",
        usage=_USAGE.get(_name),
        **_places.get(_name, {}),
    )
for _name in ("--help", "--version"):
    app[_name].group, app[_name].sort_key = _places[_name].values()


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; exit with 0 done, 2 unusable input, 128 + N ended by signal N, 1 anything else."""
    sys.exit(_run(sys.argv[1:] if arguments is None else arguments))


def _run(arguments: list[str]) -> int:
    try:
        open_closed_streams()
        if not sys.warnoptions and "PNEUMARM_DEBUG" not in os.environ:
            warnings.simplefilter("ignore", RuntimeWarning)  # NumPy's, which are not for whoever calls a command
        signals_as_exceptions()
        arguments, level = take_option(arguments, LOG, "one of " + ", ".join(LEVELS))
        print_lines(checked_level(level))
        arguments, config = take_config(arguments, app)
        app.config = () if config is None else (config,)
        app.help_formatter = AllOptions() if HELP_ALL in arguments else FewOptions()
        arguments = [HELP if one == HELP_ALL else one for one in arguments]
        with _told_in_full(arguments) if HELP in arguments else nullcontext():
            app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
    except UnusedCliTokensError as error:
        complain(_too_many(error))
        return 2
    except CycloptsError as error:
        complain(f"{error} See {' '.join(['pneumarm', *(error.command_chain or ())])} --help.")
        return 2
    except PneumarmError as error:
        if os.environ.get("PNEUMARM_DEBUG"):
            traceback.print_exc()
        complain(error)
        return error.exit_code
    except KeyboardInterrupt as error:
        complain(_interrupted(arguments, str(error)))
        return getattr(error, "exit_code", 128 + signal.SIGINT)
    except (BrokenPipeError, SystemExit) as error:
        if not isinstance(error, BrokenPipeError) and not isinstance(error.__context__, BrokenPipeError):
            raise  # of anything but Rich, which makes that of a broken pipe
        return _with_nobody_to_read()
    except Exception as error:
        if os.environ.get("PNEUMARM_DEBUG"):
            raise
        if isinstance(error, OSError) and error.errno in (*_NO_BUG, *_NO_NAME):
            complain(f"{error.filename or 'standard output'}: {error.strerror}")
            if error.errno in _NO_NAME:
                return 2
            with suppress(OSError):
                sys.stdout.close()  # or Python would try once more to write what is left
        else:
            complain(f"{type(error).__name__}: {error} ({_cause(error)})")
        return 1
    return 0


def _with_nobody_to_read() -> int:
    """Have what is still to be printed go nowhere; return what a shell reports of a program that SIGPIPE ended."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for stream in (sys.stdout, sys.stderr):
            os.dup2(nowhere, stream.fileno())
    return 128 + getattr(signal, "SIGPIPE", 13)  # Windows has none


def _cause(error: Exception) -> str:
    """Return what made an ``error`` that nobody expected, and what to do."""
    passed = {Path(frame.filename).parts[-3:] for frame in traceback.extract_tb(error.__traceback__)}
    if ("numba", "core", "caching.py") in passed:
        from pneumarm.kernels import CACHE_FOLDER

        return f"compiled code on the disk is damaged: delete the folder {CACHE_FOLDER} and try again"
    return "a bug in pneumarm: PNEUMARM_DEBUG=1 shows where"


def _too_many(error: UnusedCliTokensError) -> str:
    """Return what is said to whoever gave words that no place is for; most likely they name what is to be written."""
    command, given = " ".join(["pneumarm", *(error.command_chain or ())]), error.unused_tokens or []
    writes = error.target is not None and "out" in inspect.signature(error.target).parameters
    hint = f" What it writes is named by --out: --out {given[0]}." if given and writes else ""
    return f"{command}: expected nothing more, got {' '.join(given)}.{hint} See {command} --help."


def _interrupted(arguments: list[str], reason: str) -> str:
    """Return what is said to whoever interrupted the command of ``arguments``."""
    called = [name for name in COMMANDS if arguments[: len(name.split())] == name.split()]
    closed = "; the arm is closed" if any(name in MOVING for name in called) else ""
    again = "".join(f". Call {name} again to continue" for name in called if name in RESUMED)
    return f"interrupted{f' ({reason})' if reason else ''}{closed}{again}"


@contextmanager
def _told_in_full(arguments: list[str]) -> Iterator[None]:
    """Have the help of a command tell what its function tells; its one line is for the list of commands."""
    command, apps, _ = app.parse_commands([one for one in arguments if one != HELP])
    found, short = apps[-1], apps[-1].help
    found.help = None if " ".join(command) in COMMANDS else short
    try:
        yield
    finally:
        found.help = short


if __name__ == "__main__":
    main()
