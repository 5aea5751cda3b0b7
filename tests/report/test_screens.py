"""The pages in a real browser: on a phone, on a tablet and on a desk, light, dark and in print."""

import io
from collections.abc import Iterator
from pathlib import Path

import builders
import pytest
from PIL import Image
from playwright.sync_api import Browser, Page

from live.browser import WIDTHS, opened_browser, smallest_text, too_wide
from live.chromium import missing
from pneumarm.report import run_page

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing())
READABLE = 11.0  # px
LETTERS = 733.0  # px, of a figure of 7.4 inch whose smallest letters, of 8 points, are to be READABLE


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("screens") / "report.html"
    file.write_text(run_page(builders.run(small=True)), encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with opened_browser() as browser:
        yield browser


def shown(browser: Browser, report: Path, width: int, **options: object) -> Page:
    page = browser.new_page(viewport={"width": width, "height": WIDTHS[width]}, **options)  # type: ignore[arg-type]
    page.goto(report.as_uri())
    return page


def background(page: Page) -> int:
    """Return how light the corner of what is seen is, 0 to 255."""
    corner = Image.open(io.BytesIO(page.screenshot())).convert("L").getpixel((2, 2))
    assert isinstance(corner, int)
    return corner


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_page_fits_and_can_be_read(browser: Browser, report: Path, width: int, scheme: str) -> None:
    page = shown(browser, report, width, color_scheme=scheme)
    assert too_wide(page) <= 0
    size, text = smallest_text(page)
    assert size >= READABLE, text
    widths = page.evaluate("[...document.images].map((one) => one.getBoundingClientRect().width)")
    assert len(widths) > 3
    assert min(widths) >= LETTERS
    assert background(page) > 250 if scheme == "light" else background(page) < 40
    page.close()


def test_a_page_is_printed_light_and_whole(browser: Browser, report: Path) -> None:
    page = shown(browser, report, 800, color_scheme="dark")
    page.emulate_media(media="print")
    assert background(page) > 250
    assert too_wide(page) <= 0
    assert page.pdf().startswith(b"%PDF")
    page.close()
