"""One self-contained HTML page of sections with text, figures and tables; it asks nothing of any network."""

import base64
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

from pneumarm.moving.told import ToldFigure
from pneumarm.report.style import Described, svg


@dataclass(frozen=True)
class Picture:
    """A figure, what it shows in general (caption) and what is to be seen in it (text alternative)."""

    drawn: Figure | str | Callable[[], Figure]
    """Drawn, or an SVG as text, or what draws it when it is asked for."""
    caption: str
    alt: str = ""
    """That of a figure that carries its own where none is given."""
    narrow: str | None = None
    """The same SVG, laid out for the width of a phone. A figure that has it also knows dark screens by itself."""

    def __post_init__(self) -> None:
        if not self.alt:
            if not isinstance(self.drawn, Described) or not self.drawn.alt:
                raise ValueError(f"a picture needs a text alternative: {self.caption}")
            object.__setattr__(self, "alt", self.drawn.alt)

    @cached_property
    def figure(self) -> Figure | str:
        """The figure, or its SVG as text."""
        return self.drawn() if callable(self.drawn) else self.drawn


@dataclass(frozen=True)
class Table:
    """A table; the first cell of each row is its heading."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str
    words: bool = False
    """Whether the cells hold words, set to the left, rather than numbers, set to the right."""

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.header):
                raise ValueError(f"a row of {len(self.header)} cells was expected, got {row!r}")


@dataclass(frozen=True)
class Section:
    """A section of the page: paragraphs, then its tables, then its pictures; where a page opens, pictures first."""

    title: str
    text: Sequence[str] = ()
    figures: Sequence[Picture] = ()
    tables: Sequence[Table] = field(default=())
    opens: bool = False
    """Whether the page opens with it, before its contents."""
    folded: bool = False
    """Whether only its title is seen until somebody opens it. A page that folds needs no contents."""

    @property
    def anchor(self) -> str:
        """The section's id on the page."""
        return anchor_of(self.title)


def anchor_of(title: str) -> str:
    """Return the id of the section called ``title``."""
    return "section-" + re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")


@dataclass(frozen=True)
class Light:
    """A question about a run, answered."""

    question: str
    good: bool | None
    """None where it is not known."""
    answer: str
    """In a word."""
    words: str
    title: str
    """Of the section that says more."""


def render(
    title: str,
    summary: Sequence[str],
    sections: Sequence[Section],
    headline: Sequence[ToldFigure] = (),
    lights: Sequence[Light] = (),
) -> str:
    """Return the page as HTML text; the same sections give the same text.

    Args:
        title: of the page.
        summary: paragraphs under the title.
        sections: in order; their titles must differ.
        headline: the figures that the page opens with, large.
        lights: questions and answers, after what it opens with.

    """
    anchors = [section.anchor for section in sections]
    if len(set(anchors)) != len(anchors):
        raise ValueError(f"the titles of sections must differ, got {[s.title for s in sections]}")
    environment = Environment(
        loader=PackageLoader("pneumarm.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["embedded"] = embedded
    template = environment.get_template("page.html")
    known = [(one, anchor_of(one.title) if anchor_of(one.title) in anchors else "") for one in lights]
    return template.render(
        title=title,
        summary=summary,
        sections=list(_numbered(sections)),
        headline=headline,
        lights=known,
        folds=any(section.folded for section in sections),
    )


def _numbered(sections: Sequence[Section]) -> Iterator[dict[str, Any]]:
    """Give figures and tables their running numbers."""
    figures = tables = 0
    for section in sections:
        first_figure, first_table = figures + 1, tables + 1
        figures, tables = figures + len(section.figures), tables + len(section.tables)
        yield {
            "section": section,
            "opens": section.opens,
            "figures": list(enumerate(section.figures, first_figure)),
            "tables": list(enumerate(section.tables, first_table)),
        }


def embedded(figure: Figure | str) -> str:
    """Return ``figure`` as a data URI. As an image of its own its ids cannot clash with those of another figure."""
    text = figure if isinstance(figure, str) else svg(figure)
    return "data:image/svg+xml;base64," + base64.b64encode(text.encode()).decode()
