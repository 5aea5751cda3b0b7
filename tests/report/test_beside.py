"""The report that is begun beside a run: the same page, whatever becomes of the process that begins it."""

import shutil
import sys
from pathlib import Path
from time import monotonic, sleep

import pytest

from pneumarm.errors import UnusableInput
from pneumarm.report import beside
from pneumarm.report.beside import ReportBeside
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


def written(folder: Path) -> str:
    """Return the page of the run in ``folder``, without its report there."""
    text = (folder / "report.html").read_text()
    (folder / "report.html").unlink()
    return text


def test_the_page_is_the_one_that_is_written_at_once(run: Path) -> None:
    write_report(run)
    at_once = written(run)
    with ReportBeside(run) as page:
        page.begin()
        for part in PARTS:
            page.draw(part)
        page.write()
    assert written(run) == at_once


def test_parts_that_are_not_asked_for_are_drawn_at_the_end(run: Path) -> None:
    write_report(run)
    at_once = written(run)
    with ReportBeside(run) as page:
        page.begin()
        page.draw("learned")
        page.write()
    assert written(run) == at_once


def test_what_the_arm_changes_is_read_when_it_is_written(run: Path) -> None:
    results = run / "results.json"
    text = results.read_text()
    moved = results.read_text().replace('"transfer"', '"before"')
    results.write_text(moved)
    with ReportBeside(run) as page:
        page.begin()
        page.draw("learned")
        results.write_text(text)
        page.write()
    beside_it = written(run)
    write_report(run)
    assert written(run) == beside_it


@pytest.mark.parametrize("script", ["exit 1", "sleep 60 & wait", "read line; exit 3"])
def test_a_process_that_fails_or_hangs_is_done_without(
    script: str, run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bad = tmp_path / "python"
    bad.write_text(f"#!/bin/sh\n{script}\n")
    bad.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(bad))
    monkeypatch.setattr(beside, "_PATIENCE", 0.5)
    with ReportBeside(run) as page:
        page.begin()
        page.write()
    assert (run / "report.html").exists()
    assert page._process is not None
    assert page._process.returncode != 0


def test_one_that_cannot_begin_is_done_without(run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", str(tmp_path / "missing"))
    with ReportBeside(run) as page:
        page.begin()
        page.write()
    assert (run / "report.html").exists()


def test_a_file_that_is_damaged_is_told_of_as_ever(run: Path) -> None:
    (run / "results.json").write_text("{")
    with ReportBeside(run) as page:
        page.begin()
        with pytest.raises(UnusableInput, match="expected a JSON file"):
            page.write()


def test_nothing_is_written_where_the_run_is_left_before(run: Path) -> None:
    with ReportBeside(run) as page:
        page.begin()
    process = page._process
    assert process is not None
    began = monotonic()
    while process.poll() is None and monotonic() - began < PATIENCE:
        sleep(0.05)
    assert process.returncode is not None
    assert not (run / "report.html").exists()
