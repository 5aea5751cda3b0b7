"""The documentation site is built without a warning: every link and every name in it is there."""

import re
from pathlib import Path

import pytest

from children import python

ROOT = Path(__file__).parents[1]


def test_the_site_is_built_and_shows_the_front_door(tmp_path: Path) -> None:
    pytest.importorskip("mkdocs")
    pytest.importorskip("mkdocstrings_handlers.python")
    done = python("-m", "mkdocs", "build", "--strict", "--site-dir", tmp_path / "site", cwd=ROOT)
    assert done.returncode == 0, done.stderr
    reference = (tmp_path / "site" / "reference.html").read_text()
    assert 'id="pneumarm.api.collect"' in reference
    assert not re.search(r":(class|func|mod):<", reference)
    tutorial = re.sub(r"<[^>]+>", "", (tmp_path / "site" / "tutorial.html").read_text())
    assert "pneumarm.collect(ARM, " in tutorial


def test_what_cites_the_package_has_its_version() -> None:
    import pneumarm

    cited = (ROOT / "CITATION.cff").read_text()
    assert f"version: {pneumarm.__version__}\n" in cited
