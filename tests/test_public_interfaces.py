"""The package uses what its dependencies document, and changes nothing of theirs."""

import ast
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import pneumarm
from children import python

SOURCE = Path(pneumarm.__file__).parent
DOCUMENTED = {
    *("PIL", "cyclopts", "cyclopts.config", "cyclopts.help", "dask.distributed", "filelock", "joblib", "jinja2"),
    *("gymnasium", "gymnasium.error", "gymnasium.spaces", "gymnasium.vector", "gymnasium.vector.utils"),
    *("h5py", "llvmlite", "minari", "msgspec", "numba", "numba.experimental", "numba.extending"),
    "numba.core",  # for numba.core.event
    *("matplotlib", "matplotlib.axes", "matplotlib.backends.backend_agg", "matplotlib.backends.backend_svg"),
    *(
        "matplotlib.colors",
        "matplotlib.figure",
        "matplotlib.lines",
        "matplotlib.patches",
        "matplotlib.path",
        "matplotlib.ticker",
    ),
    *("numpy", "numpy.typing", "numpy.lib.stride_tricks", "onnx", "onnx.helper", "onnx.numpy_helper"),
    *("platformdirs", "psutil", "pyarrow", "pyarrow.parquet", "pygame", "rerun", "tensorboardX", "uvicorn"),
    *("rich.console", "rich.logging", "rich.markdown", "rich.progress", "rich.status", "rich.table", "rich.text"),
    *("safetensors", "safetensors.numpy", "scipy.spatial", "serial", "serial.tools", "serial.tools.list_ports"),
    *("sqlalchemy", "sqlalchemy.dialects.mysql", "sqlalchemy.dialects.postgresql", "sqlalchemy.exc"),
    *("stable_baselines3", "stable_baselines3.common.vec_env"),
    *("starlette.applications", "starlette.requests", "starlette.responses", "starlette.routing"),
    "starlette.websockets",
}
"""Modules of dependencies that their documentation describes."""


def sources() -> Iterator[tuple[str, ast.Module]]:
    for file in sorted(SOURCE.rglob("*.py")):
        yield file.relative_to(SOURCE).as_posix(), ast.parse(file.read_text())


def is_foreign(module: str) -> bool:
    return module.split(".")[0] not in {*sys.stdlib_module_names, "pneumarm"}


def imports(tree: ast.AST) -> Iterator[tuple[str, str, str]]:
    """Yield each import from dependencies: the module, the name imported from it ("" for itself), the name here."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (
                (one.name, "", one.asname or one.name.split(".")[0]) for one in node.names if is_foreign(one.name)
            )
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and is_foreign(node.module or ""):
            yield from ((node.module or "", one.name, one.asname or one.name) for one in node.names)


def is_private(name: str) -> bool:
    return name.startswith("_") and not name.endswith("__")


def root(node: ast.AST) -> str:
    """Return the name that a chain of attributes begins with."""
    while isinstance(node, ast.Attribute | ast.Subscript):
        node = node.value
    return node.id if isinstance(node, ast.Name) else ""


def changed(tree: ast.AST) -> Iterator[str]:
    """Yield what is assigned to attributes of dependencies, also by another name or by ``setattr``."""
    theirs = {here for _, _, here in imports(tree)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign | ast.AnnAssign) and isinstance(node.value, ast.Attribute | ast.Name):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            if root(node.value) in theirs:
                theirs |= {one.id for one in targets if isinstance(one, ast.Name)}
    for node in ast.walk(tree):
        is_stored = isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store | ast.Del)
        is_set = isinstance(node, ast.Call) and root(node.func) in ("setattr", "delattr") and node.args
        if (is_stored and root(node) in theirs) or (is_set and root(node.args[0]) in theirs):
            yield ast.unparse(node)


def private(tree: ast.AST, own: set[str]) -> Iterator[str]:
    """Yield private names that are imported, used or handed over, except those of our ``own``."""
    yield from (f"{module}.{name}" for module, name, _ in imports(tree) if is_private(name))
    for node in ast.walk(tree):
        name = node.attr if isinstance(node, ast.Attribute) else node.arg if isinstance(node, ast.keyword) else None
        if is_private(name or "") and name not in own:
            yield ast.unparse(node)


def defined(tree: ast.AST) -> Iterator[str]:
    """Yield the names that a source gives to functions, classes, arguments, variables and attributes of its own."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.arg):
            yield node.arg
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) and root(node) in ("self", "cls"):
            yield node.attr


NAMEDTUPLE = {"_replace", "_fields", "_asdict", "_make"}
"""The standard library documents these."""


def test_only_documented_modules_are_imported():
    used = {module for _, tree in sources() for module, _, _ in imports(tree)}
    assert used - DOCUMENTED == set()


def test_no_private_name_of_a_dependency_is_used():
    own = NAMEDTUPLE | {name for _, tree in sources() for name in defined(tree)}
    found = [f"{file}: {one}" for file, tree in sources() for one in private(tree, own)]
    assert found == []


def test_no_attribute_of_a_dependency_is_assigned():
    assert [f"{file}: {one}" for file, tree in sources() for one in changed(tree)] == []


@pytest.mark.parametrize(
    ("source", "is_found"),
    [
        ("import numba\nnumba.config.OPT = 1", changed),
        ("import numba\nconfig: object = numba.config\nconfig.OPT = 1", changed),
        ("from numba.np import arrayobj\nsetattr(arrayobj, 'f', None)", changed),
        ("from numba.core.dispatcher import _dispatcher", lambda tree: private(tree, set())),
        ("dispatcher._cache", lambda tree: private(tree, set())),
        ("numba.njit(_nrt=False)", lambda tree: private(tree, set())),
    ],
)
def test_what_is_not_allowed_is_found(source, is_found):
    assert list(is_found(ast.parse(source)))


FOREIGN = """
import re, sys
import numba
import numpy as np

def settings():
    return {name: repr(getattr(numba.config, name)) for name in dir(numba.config) if name.isupper()}

before = settings()
if sys.argv[1] == "with":
    import pneumarm
    import pneumarm.kernels, pneumarm.vectors, pneumarm.learning, pneumarm.arm.virtual
assert settings() == before

@numba.njit(fastmath=True)
def foreign(x, y):
    total = 0.0
    for i in range(len(x)):
        y[1:3] = x[:2]
        total += x[i] * y[i] / (1.0 + x[i])
    return total

foreign(np.ones(9), np.ones(9))
(code,) = foreign.inspect_asm().values()
print(re.sub(r"foreign(B\\d+)?v\\d+|B\\d+v\\d+|\\.\\d{12,}[.\\w]*|at 0x[0-9a-f]+", "foreign", code))
"""


def test_numbas_settings_and_what_others_compile_stay_as_they_are(tmp_path):
    (tmp_path / "foreign.py").write_text(FOREIGN)
    inside = os.environ | {"PYTHONHASHSEED": "0"}  # Numba names constants by their hash
    alone, together = (
        python(tmp_path / "foreign.py", how, env=inside, check=True).stdout for how in ("alone", "with")
    )
    assert len(re.findall(r"\n", alone)) > 100
    assert together == alone
