"""The README stays a front door: short, and the second thing a newcomer types is the live page."""

from pathlib import Path

from readme import blocks

README = Path(__file__).parents[1] / "README.md"
MOST_LINES = 120


def test_the_readme_is_short_and_begins_with_a_picture() -> None:
    text = README.read_text()
    assert len(text.splitlines()) < MOST_LINES
    assert text.index("<img ") < text.index("```")


def test_after_the_whole_job_a_newcomer_types_live() -> None:
    typed = [line.partition("#")[0].strip() for line in blocks()[0].splitlines()]
    assert typed[:3] == ["make run", ". .venv/bin/activate", "pneumarm live"]
