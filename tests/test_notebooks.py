"""The notebooks run from first to last, and draw."""

from pathlib import Path

import pytest

NOTEBOOKS = Path(__file__).parents[1] / "examples" / "notebooks"
ORDER = ("from_a_bare_arm", "follow_a_reference", "look_at_a_recording")
"""The first makes what the others need."""
LIMIT = 600
"""Of a cell [s], with all that it compiles."""


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("desk")


def run(desk: Path, name: str) -> int:
    """Run a notebook in the folder ``desk``; return how many pictures it drew."""
    nbformat = pytest.importorskip("nbformat")
    client = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    book = nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4)
    nbformat.validate(book)
    assert not any(cell.get("outputs") for cell in book.cells), "notebooks are kept without outputs"
    client.NotebookClient(book, timeout=LIMIT, resources={"metadata": {"path": str(desk)}}).execute()
    return sum(
        bool({"image/png", "text/html"} & output.get("data", {}).keys())
        for cell in book.cells
        for output in cell.get("outputs", [])
    )


def test_all_notebooks_are_run() -> None:
    assert {one.stem for one in NOTEBOOKS.glob("*.ipynb")} == set(ORDER)


def test_notebooks_run_one_after_the_other(desk: Path) -> None:
    drawn = [run(desk, name) for name in ORDER]
    assert drawn == [3, 2, 2]
