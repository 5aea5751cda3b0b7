"""The report that is begun beside a run: the same page, whatever becomes of the process that begins it."""

import json
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from time import monotonic, sleep

import pytest

from children import python
from once import made_once
from pneumarm.errors import UnusableInput
from pneumarm.report import beside
from pneumarm.report.beside import WRITE, ReportBeside
from pneumarm.report.drawn import draw
from pneumarm.report.files import RESULTS, SPEC
from pneumarm.report.run_report import write_report
from pneumarm.report.sections import PARTS

PATIENCE = 120.0


@pytest.fixture
def run(small_run: Path, tmp_path: Path) -> Path:
    """A finished run, but for its report."""
    folder = tmp_path / "run"
    shutil.copytree(small_run, folder)
    (folder / "report.html").unlink()
    return folder


@pytest.fixture
def bare(small_run: Path, tmp_path: Path) -> Path:
    """A finished run of which hardly anything is left to be drawn, which takes a moment."""
    folder = tmp_path / "bare"
    folder.mkdir()
    for name in (RESULTS, SPEC):
        shutil.copy(small_run / name, folder)
    return folder


@pytest.fixture(scope="module")
def at_once(small_run: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The page of that run, written in one go."""

    def write(folder: Path) -> None:
        shutil.copytree(small_run, folder, dirs_exist_ok=True)
        (folder / "report.html").unlink()
        write_report(folder)

    return (made_once(tmp_path_factory, "written_at_once", write) / "report.html").read_text()


def written(folder: Path) -> str:
    """Return the page of the run in ``folder``, without its report there."""
    text = (folder / "report.html").read_text()
    (folder / "report.html").unlink()
    return text


def test_the_page_is_the_one_that_is_written_at_once(run: Path, at_once: str) -> None:
    with ReportBeside(run) as page:
        page.begin()
        for part in PARTS:
            page.draw(part)
        page.write()
    assert written(run) == at_once


def test_parts_that_are_not_asked_for_are_drawn_at_the_end(run: Path, at_once: str) -> None:
    with ReportBeside(run) as page:
        page.begin()
        page.draw("learned")
        page.write()
    assert written(run) == at_once


def test_parts_say_what_the_whole_run_says_of_them(run: Path, at_once: str) -> None:
    """They are drawn before the stages that follow are done; what those add is read when the page is written."""
    results = run / "results.json"
    whole = json.loads(results.read_text())
    assert {"transfer", "bound"} <= whole.keys()

    def words() -> Iterator[str]:
        for part, later in (("learned", {"transfer", "bound"}), ("moved", {"bound"}), ("reached", {"bound"})):
            results.write_text(json.dumps({name: value for name, value in whole.items() if name not in later}))
            yield part
        results.write_text(json.dumps(whole))
        yield WRITE

    draw(run, words())
    assert written(run) == at_once


@pytest.mark.parametrize("script", ["exit 1", "sleep 60 & wait", "read line; exit 3"])
def test_a_process_that_fails_or_hangs_is_done_without(
    script: str, bare: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bad = tmp_path / "python"
    bad.write_text(f"#!/bin/sh\n{script}\n")
    bad.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(bad))
    monkeypatch.setattr(beside, "_PATIENCE", 0.5)
    with ReportBeside(bare) as page:
        page.begin()
        page.write()
    assert (bare / "report.html").exists()
    assert page._process is not None
    assert page._process.returncode != 0


def test_one_that_cannot_begin_is_done_without(bare: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", str(tmp_path / "missing"))
    with ReportBeside(bare) as page:
        page.begin()
        page.write()
    assert (bare / "report.html").exists()


def test_a_file_that_is_damaged_is_told_of_as_ever(bare: Path) -> None:
    (bare / "results.json").write_text("{")
    with ReportBeside(bare) as page:
        page.begin()
        with pytest.raises(UnusableInput, match="expected the results of a finished run"):
            page.write()


def test_nothing_is_written_where_the_run_is_left_before(bare: Path) -> None:
    with ReportBeside(bare) as page:
        page.begin()
    process = page._process
    assert process is not None
    began = monotonic()
    while process.poll() is None and monotonic() - began < PATIENCE:
        sleep(0.05)
    assert process.returncode is not None
    assert not (bare / "report.html").exists()


def test_what_a_run_needs_draws_nothing() -> None:
    """A library that draws takes a second to load, and only the process beside a run needs it."""
    done = python(
        "-c", "import sys, pneumarm.commands.run_; print({'matplotlib', 'jinja2', 'PIL'} & sys.modules.keys())"
    )
    assert done.stdout.strip() == "set()", done.stderr
