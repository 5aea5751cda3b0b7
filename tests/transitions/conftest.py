"""Sequences to store, and processes that are watched, limited or killed."""

import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))  # for the stand-ins, here and in processes of their own

from servers import MySQL, PostgreSQL, Served  # noqa: E402
from stand_ins import make_recorded  # noqa: E402

import children  # noqa: E402
from pneumarm.arm.virtual import VirtualArm, draw_parameters  # noqa: E402
from pneumarm.transitions import CollectSettings, Mark, Store, collect  # noqa: E402


@pytest.fixture
def recorded():
    return make_recorded


@pytest.fixture(scope="session")
def postgresql() -> Iterator[PostgreSQL]:
    server = PostgreSQL()
    yield server
    server.close()


@pytest.fixture(scope="session")
def mysql() -> Iterator[MySQL]:
    server = MySQL()
    yield server
    server.close()


@pytest.fixture(params=["postgresql", "mysql"])
def served(request: pytest.FixtureRequest) -> Served:
    """Return a server, of one kind after the other."""
    return request.getfixturevalue(request.param)


@pytest.fixture(params=["file", "postgresql", "mysql"])
def place(request: pytest.FixtureRequest, tmp_path: Path) -> Callable[[], Path | str]:
    """Return what gives addresses at which there is nothing yet: of files, or on a server."""
    if request.param == "file":
        return lambda: tmp_path / f"{len(list(tmp_path.iterdir()))}.db"
    served: Served = request.getfixturevalue(request.param)
    return served.new


@pytest.fixture
def address(place: Callable[[], Path | str]) -> Path | str:
    """Return where a store can be made."""
    return place()


@pytest.fixture
def python():
    """Run a script in a process of its own; returns the completed process."""

    def run(script, *arguments):
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(HERE), *sys.path])}
        return children.python("-c", script, *arguments, env=environment)

    return run


@pytest.fixture(scope="module", params=[1, 2])
def exportable(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a store of one or of two joints; the latter with a sensor of velocity; some rows are marked."""
    path = tmp_path_factory.mktemp("recorded") / "arm.db"
    arm = VirtualArm(draw_parameters(3, request.param), seed=3, velocity_sensor=request.param == 2)
    with arm, Store.for_arm(path, arm.spec) as store:
        collect(arm, store, 2_000, settings=CollectSettings(actions=100))
        store.mark(3, [Mark(10, 20, "a test")])
    return path
