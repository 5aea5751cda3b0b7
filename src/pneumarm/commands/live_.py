"""``pneumarm live``."""

import secrets
import sys
from contextlib import suppress
from pathlib import Path

from pneumarm.commands.common import Json, OwnMethod, open_page
from pneumarm.console import say, show, table
from pneumarm.errors import UnusableInput
from pneumarm.live.learning import TRANSFER, TRANSITIONS
from pneumarm.live.live_arm import LiveArm
from pneumarm.live.server import LiveServer
from pneumarm.progress import progress
from pneumarm.run import SETTINGS, RunSettings, settings_in

LOCAL = ("127.0.0.1", "localhost", "::1")
_RUN = Path("pneumarm-run")


def live_(
    *controllers: str,
    arm: str | None = None,
    host: str = "127.0.0.1",
    port: int = 8642,
    token: str | None = None,
    browser: bool | None = None,
    transitions: int = TRANSITIONS,
    seed: int = 0,
    method: OwnMethod = None,
    json: Json = False,
) -> None:
    """Show an arm in the browser, moving; drag its goal, draw a movement, stop it, see what is wrong with it.

    The first page to take control moves the arm, the others watch, and any of them can stop it. A moving arm whose
    page is gone holds, and is vented after three seconds. Ctrl-C vents and closes the arm.

    Parameters
    ----------
    controllers
        The folder of a run, files of agents or of ``pneumarm tune``, or plan:SIM. With a folder in which nothing has
        been learned yet, by default pneumarm-run, the page does the whole job at the press of a button.
    arm
        virtual, virtual:seed=N, serial:PORT, simulation:FILE or python:module:callable; by default that of the run,
        or else virtual.
    host
        Address to serve the page at: that of this machine, or 0.0.0.0, for a phone beside the arm. Whoever opens it
        from elsewhere needs the token in the address that is printed.
    port
        Port to serve the page at; 0 for any that is free.
    token
        What the address of the page must hold; by default made up where others than this machine can reach it.
    browser
        Open the page; by default where there is a screen, a terminal and no variable CI.
    transitions
        Readings to record where the arm has still to learn.
    seed
        Random seed of a virtual arm's noise and of what is learned.
    method
        The method that trained the agent, MODULE:NAME, if that is one of your own that is not installed.
    """
    folder, named = _sorted(controllers)
    known = settings_in(folder, (arm, method)) if folder is not None and arm is None else None
    settings = RunSettings(
        arm=arm or (known.arm if known is not None else "virtual"),
        seed=seed,
        transitions=transitions,
        test_episodes=1000,
        bound_episodes=0,
        transfer=TRANSFER,
    )
    if not token:
        token = None if host in LOCAL else secrets.token_urlsafe(12)
    with progress(f"opening {settings.arm}"):
        live_arm = LiveArm(settings, named, folder, method)
    server = LiveServer(live_arm, host, port, token)

    def opened() -> None:
        say(f"open {server.url}")
        open_page(server.url, browser, sys.stderr)

    with live_arm, suppress(KeyboardInterrupt):  # that is how it is meant to end
        server.run(opened)
    result = {"url": server.url, "figures": live_arm.screen.state.get("figures", {})}
    rows = [(name, *found.values()) for name, found in result["figures"].items()]
    header = ("controller", "goals", "settled", "median time [s]", "rest error [deg]", "last curve [deg]")
    show(result, json, lambda: [table(header, rows, settings.arm)] if rows else [])


def _sorted(controllers: tuple[str, ...]) -> tuple[Path | None, list[str]]:
    """Return the folder of a run among what was named, if there is one, and the files of controllers.

    Raises:
        UnusableInput: two folders, or a file that does not exist.

    """
    if not controllers:
        return _RUN, []
    folders = [name for name in controllers if Path(name).is_dir() or _is_new(name)]
    files = [name for name in controllers if name not in folders]
    if len(folders) > 1:
        raise UnusableInput(f"expected the folder of one run, got {' and '.join(folders)}")
    missing = [name for name in files if not Path(name.removeprefix("plan:")).exists()]
    if missing:
        raise UnusableInput(f"there is no file {missing[0]}; give a file, or the folder of a run")
    folder = Path(folders[0]) if folders else None
    if folder is not None and folder.is_dir() and not (folder / SETTINGS).exists() and any(folder.iterdir()):
        _check_transferred(folder)
    return folder, files


def _is_new(name: str) -> bool:
    """Whether ``name`` can be the folder of a run that is to be begun."""
    path = Path(name)
    return not path.exists() and not path.suffix and not name.startswith("plan:")


def _check_transferred(folder: Path) -> None:
    if not any(folder.glob("*.safetensors")):
        raise UnusableInput(f"{folder}: holds no run, and is not empty; give another folder")
