"""A real browser without a window, for pages."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Browser, BrowserContext, Page, sync_playwright

from live.chromium import program

FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
WIDTHS = {400: 860, 800: 1000, 1280: 860}
"""Of the windows in which pages are looked at, with their heights."""

PATIENCE = 120_000
"""What a page does not show after so long [ms] it never will; a machine with much else to do takes a minute."""


def keep(page: Page, name: str) -> None:
    """Take a screenshot of the whole ``page``, for people, into the folder PNEUMARM_SCREENSHOTS where that is set."""
    taken = page.screenshot(full_page=True)
    if folder := os.environ.get("PNEUMARM_SCREENSHOTS"):
        Path(folder).mkdir(parents=True, exist_ok=True)
        (Path(folder) / f"{name}.png").write_bytes(taken)


def emptiness(page: Page, name: str) -> list[float]:
    """Return which share of each printed page is empty at its end; keep what is printed as :func:`keep` does."""
    import pypdfium2

    left = []
    for number, sheet in enumerate(pypdfium2.PdfDocument(page.pdf(format="A4", prefer_css_page_size=True))):
        drawn = sheet.render(scale=1).to_pil().convert("L")
        if folder := os.environ.get("PNEUMARM_SCREENSHOTS"):
            Path(folder).mkdir(parents=True, exist_ok=True)
            sheet.render(scale=1.2).to_pil().save(Path(folder) / f"{name}-print-{number + 1}.png")
        box = drawn.point(lambda ink: 255 * (ink < 200)).getbbox()
        left.append(1.0 if box is None else 1 - box[3] / drawn.height)
    return left


@contextmanager
def opened_browser() -> Iterator[Browser]:
    """Give a browser with a fresh profile."""
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=program(), args=FLAGS)
        try:
            yield browser
        finally:
            browser.close()


def window(browser: Browser, width: int = 1280, **options: object) -> BrowserContext:
    """Return a window ``width`` pixels wide, with nothing of others in it."""
    context = browser.new_context(viewport={"width": width, "height": WIDTHS[width]}, **options)  # type: ignore[arg-type]
    context.set_default_timeout(PATIENCE)
    return context


def too_wide(page: Page) -> int:
    """Return by how many pixels ``page`` is wider than its window."""
    return int(page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth"))


def smallest_text(page: Page) -> tuple[float, str]:
    """Return the size [px] of the smallest text that is seen on ``page``, and that text."""
    size, text = page.evaluate(
        """() => {
          const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
          let found = [1000, ""];
          while (walker.nextNode()) {
            const element = walker.currentNode.parentElement, text = walker.currentNode.data.trim();
            if (!text || !element.checkVisibility() || ["SCRIPT", "STYLE"].includes(element.tagName)) continue;
            const drawing = element.ownerSVGElement;
            const scale = drawing ? element.getScreenCTM().a : 1;
            const size = parseFloat(getComputedStyle(element).fontSize) * scale;
            if (size < found[0]) found = [size, text];
          }
          return found;
        }"""
    )
    return float(size), str(text)
