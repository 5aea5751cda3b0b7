"""Where the browser is that pages are tested in; what a bare Python can say, before anything is installed."""

import shutil

PACKAGES = "chromium"
"""Debian packages that bring it."""
NAMES = ("chromium", "chromium-browser", "google-chrome")


def program() -> str | None:
    """Return the path of the browser; None where there is none."""
    return next(
        (found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), None
    )


def missing() -> str:
    """Return what is missing for tests in a browser; empty where nothing is."""
    return "" if program() else f"chromium missing; Debian packages: {PACKAGES}"
