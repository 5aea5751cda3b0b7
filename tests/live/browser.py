"""A real browser without a window, for pages."""

from collections.abc import Iterator
from contextlib import contextmanager

from playwright.sync_api import Browser, Page, sync_playwright

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


@contextmanager
def opened_browser() -> Iterator[Browser]:
    """Give a browser with a fresh profile."""
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=program(), args=FLAGS)
        try:
            yield browser
        finally:
            browser.close()


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
