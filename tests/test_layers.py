"""A module imports only from its own row and those above it in ARCHITECTURE.md's table, and never in a circle."""

import ast
import re
from pathlib import Path

from tools.figures import circles, imports

import pneumarm

SOURCE = Path(pneumarm.__file__).parent
TABLE = (Path(__file__).parents[1] / "ARCHITECTURE.md").read_text()
ROWS = [re.findall(r"`([\w/.]+)`", line.split("|")[1]) for line in TABLE.splitlines() if line.startswith("| `")]
PLACES = {
    ".".join(file.relative_to(SOURCE.parent).with_suffix("").parts).removesuffix(".__init__"): file
    for file in sorted(SOURCE.rglob("*.py"))
}
"""Files by the names of their modules."""
IMPORTED = {name: imports(ast.parse(file.read_text()), set(PLACES)) - {name} for name, file in PLACES.items()}
"""What each module imports, in functions and for types too."""
ENTRANCES = {"pneumarm", "pneumarm.__main__"}
"""What only opens doors: it may import anything."""


def row_of(module: str) -> int:
    """Return the row that names the place of ``module``; the longest name wins."""
    place = PLACES[module].relative_to(SOURCE).as_posix()
    names = [(len(name), row) for row, names in enumerate(ROWS) for name in names if place.startswith(name)]
    return max(names, default=(0, -1))[1]


def opens(door: str, other: str) -> bool:
    """Return whether ``door`` is the ``__init__`` of the folder in which ``other`` lies."""
    return PLACES[door].name == "__init__.py" and other.startswith(f"{door}.")


def test_every_module_has_a_place():
    assert [module for module in PLACES if module not in ENTRANCES and row_of(module) < 0] == []


def test_imports_go_up_the_table():
    wrong = [
        f"{module} imports {other}"
        for module, others in IMPORTED.items()
        for other in others
        if module not in ENTRANCES and row_of(other) > row_of(module) and not opens(module, other)
    ]
    assert wrong == []


def test_nothing_is_imported_in_a_circle():
    assert circles(IMPORTED) == []
