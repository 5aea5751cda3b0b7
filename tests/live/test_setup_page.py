"""The first day on a page in a real browser, from the first question to the page on which the arm is dragged."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from threading import Thread

import pytest
from playwright.sync_api import Browser, Error

from children import child, wait_until
from live.browser import keep, opened_browser, too_wide, window
from live.chromium import missing
from pneumarm.arm.spec_file import load_arm_file

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing())
START = "from pneumarm.cli import main; main()"
SHOWN = """[document.title, document.querySelector("#question")?.innerText,
  [...document.querySelectorAll("#answers button")].map((one) => one.innerText)]"""
HERE = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with opened_browser() as browser:
        yield browser


@pytest.mark.thorough
@pytest.mark.parametrize("width", [400, 1280])
def test_an_arm_is_set_up_by_the_page_alone_and_can_then_be_dragged(
    browser: Browser, width: int, tmp_path: Path
) -> None:
    out, paths = tmp_path / "arm.toml", os.pathsep.join([str(HERE), os.environ.get("PYTHONPATH", "")])
    said: list[str] = []
    options = ["--page", "--port", 0, "--out", out, "--measure.rest", 3, "--measure.settle", 2]
    command = [sys.executable, "-c", START, "setup", "python:setup_arms:sound", *options]
    with child(*command, env={**os.environ, "PYTHONPATH": paths}) as process:
        assert process.stderr is not None
        url = process.stderr.readline().split()[-1]
        page, asked = window(browser, width).new_page(), list[str]()
        page.goto(url)
        page.get_by_role("button", name="Stop").wait_for()

        def answer() -> bool:
            """Answer what is asked; return whether the page of the arm is there."""
            try:
                title, question, offered = page.evaluate(SHOWN)
            except Error:  # the page of the arm comes in its place
                return False
            if "setup" not in title:
                return True
            if not question or not offered:
                return False
            asked.append(question)
            if len(asked) == 3:
                page.get_by_role("button", name="Stop").click()
                page.get_by_text("Stopped: everything is vented.").wait_for()
                return False
            if "checked for two minutes" in question:
                keep(page, f"setup-{width}")
                assert too_wide(page) == 0
            wanted = "Yes" if "click?" in question else "Go on" if "go on as it is" in question else "Enter"
            page.locator("#answers button").filter(has_text=wanted).click()
            return False

        Thread(target=lambda: [said.append(line) for line in process.stderr or []], daemon=True).start()
        try:
            wait_until("the arm can be dragged", answer, process)
        except AssertionError as error:
            raise AssertionError(f"{error}; asked {asked}, said {''.join(said)}") from error
        page.locator("#begin").wait_for()
        assert "Learn to move it" in page.locator("#begin").inner_text()
    assert load_arm_file(out).setup is None
    assert "Go on where that was? Then press Enter." in asked
    assert sum("click?" in one for one in set(asked)) == 4
