"""What only POSIX has is imported where it is needed alone: everything can be imported without it."""

import pkgutil
import tomllib
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from packaging.requirements import Requirement

import pneumarm
from children import python

POSIX_ONLY = ("fcntl", "grp", "pty", "pwd", "resource", "termios", "tty")
PROGRAM = """
import builtins, importlib, os, signal
os.environ["USERNAME"] = "somebody"
def without(name, globals=None, locals=None, fromlist=(), level=0, imported=builtins.__import__):
    if name in {blocked} and (globals or {{}}).get("__name__", "").startswith("pneumarm"):
        raise ImportError(name)
    return imported(name, globals, locals, fromlist, level)
builtins.__import__ = without  # libraries know for themselves where they are
for name in ("SIGHUP", "SIGUSR1", "SIGUSR2"):
    delattr(signal, name)
for name in ("getuid", "O_CLOEXEC", "sched_getaffinity"):
    delattr(os, name)
import pneumarm.cli
for name in {modules}:
    importlib.import_module(name)
from pneumarm.console import peak_memory
from pneumarm.leaving import signals_as_exceptions
assert peak_memory() > 1
signals_as_exceptions()
from pneumarm.cli import main
main(["arm", "emulate", "virtual", "--link", "arm.port"])
"""


def test_every_module_is_imported_without_what_only_posix_has() -> None:
    """And what cannot work then says so in a line; names that Windows lacks are taken away, too."""
    walked = pkgutil.walk_packages(pneumarm.__path__, "pneumarm.")
    without = ("__main__", *(() if find_spec("sqlalchemy") else ("transitions.server",)))
    modules = [one.name for one in walked if not one.name.endswith(without) and ".gym" not in one.name]
    assert len(modules) > 200
    done = python("-c", PROGRAM.format(blocked=POSIX_ONLY, modules=modules))
    assert done.returncode == 2, done.stderr
    assert "emulated on Linux and macOS only" in done.stderr


def test_the_compiler_is_one_that_is_known_to_work() -> None:
    """Kernels reach into Numba: versions outside of this range fail at the first of them, or nobody has tried."""
    with open(Path(__file__).parents[1] / "pyproject.toml", "rb") as file:
        wanted = tomllib.load(file)["project"]["dependencies"]
    (numba,) = (one for one in map(Requirement, wanted) if one.name == "numba")
    assert numba.specifier.contains(version("numba"))
    for fails in ("0.61.2", "0.62.1", "0.69.0", "1.0"):
        assert not numba.specifier.contains(fails), fails
    for runs in ("0.63.0", "0.63.1", "0.65.1", "0.67.0", "0.68.1"):
        assert numba.specifier.contains(runs), runs
