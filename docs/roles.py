"""For the site: names in docstrings that are marked as classes and functions are shown as code."""

import re
from typing import Any

_ROLE = re.compile(r":(?:class|func|mod|attr|meth|data):<code>(~?)[.]*([\w.]+)</code>")


def on_page_content(html: str, **given: Any) -> str:
    """Return the page with ``:class:`~a.b.C``` as ``C`` in code."""
    return _ROLE.sub(lambda found: f"<code>{found[2].rpartition('.')[2] if found[1] else found[2]}</code>", html)
