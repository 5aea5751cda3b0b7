"""A result is opened where somebody sees it: a screen, a terminal, no CI; its address is said always."""

import io
import shutil
import sys
from pathlib import Path

import pytest

from pneumarm.commands.common import open_page
from pneumarm.commands.run_ import run_
from small import SMALL

PAGE = "file:///tmp/report.html"


class Terminal(io.StringIO):
    """What is written to as to a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return what has been opened, on a machine with a screen that is no CI."""
    pages: list[str] = []
    monkeypatch.setattr("webbrowser.open", pages.append)
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.delenv("CI", raising=False)
    return pages


def test_on_a_terminal_with_a_screen_it_is_opened(opened: list[str]) -> None:
    open_page(PAGE, None, Terminal())
    assert opened == [PAGE]


def test_in_ci_without_terminal_or_unwanted_it_is_not(opened: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    open_page(PAGE, None, io.StringIO())
    open_page(PAGE, False, Terminal())
    monkeypatch.setenv("CI", "true")
    open_page(PAGE, None, Terminal())
    assert opened == []
    open_page(PAGE, True, io.StringIO())  # asked for
    assert opened == [PAGE]


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="there is always a screen")
def test_without_a_screen_it_is_not(opened: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    open_page(PAGE, None, Terminal())
    assert opened == []


def test_a_run_ends_with_the_address_of_its_report(
    opened: list[str],
    small_run: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folder = tmp_path / "a run"
    shutil.copytree(small_run, folder)
    for terminal, pages in ((False, 0), (True, 1)):
        with monkeypatch.context() as changed:
            changed.setattr(sys.stdout, "isatty", lambda terminal=terminal: terminal)
            run_(out=folder, settings=SMALL)
        address = (folder / "report.html").as_uri()
        assert address.startswith("file:///")
        assert capsys.readouterr().err.splitlines()[-1] == f"report: {address}"
        assert opened == [address] * pages
