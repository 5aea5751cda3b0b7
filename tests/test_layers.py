"""A module imports only from the rows above its own in ARCHITECTURE.md's table of places."""

import ast
import re
from pathlib import Path

import pneumarm

SOURCE = Path(pneumarm.__file__).parent
TABLE = (Path(__file__).parents[1] / "ARCHITECTURE.md").read_text()
ROWS = [re.findall(r"`([\w/.]+)`", line.split("|")[1]) for line in TABLE.splitlines() if line.startswith("| `")]
ENTRANCES = ("__init__.py", "__main__.py")
"""What only opens doors: it may import anything."""


def row_of(place: str) -> int:
    """Return the row that names ``place``, a path in the package; the longest name wins."""
    names = [(len(name), row) for row, names in enumerate(ROWS) for name in names if place.startswith(name)]
    return max(names, default=(0, -1))[1]


def imported(file: Path) -> set[str]:
    """Return the places that ``file`` imports from when it is imported."""
    nodes = [node for node in ast.parse(file.read_text()).body if isinstance(node, ast.ImportFrom)]
    modules = [node.module or "" for node in nodes]
    modules += [f"pneumarm.{name.name}" for node in nodes if node.module == "pneumarm" for name in node.names]
    paths = [
        module.removeprefix("pneumarm.").replace(".", "/") for module in modules if module.startswith("pneumarm.")
    ]
    return {f"{path}.py" if (SOURCE / f"{path}.py").exists() else f"{path}/" for path in paths}


def test_every_module_has_a_place():
    files = [file.relative_to(SOURCE).as_posix() for file in SOURCE.rglob("*.py") if file.parent != SOURCE]
    files += [file.name for file in SOURCE.glob("*.py") if file.name not in ENTRANCES]
    assert [place for place in files if row_of(place) < 0] == []


def test_imports_go_up_the_table():
    wrong = []
    for file in SOURCE.rglob("*.py"):
        place = file.relative_to(SOURCE).as_posix()
        if place not in ENTRANCES:
            wrong += [f"{place} imports {other}" for other in imported(file) if row_of(other) > row_of(place)]
    assert wrong == []
