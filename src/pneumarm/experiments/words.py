"""The page of an experiment as data: ``words.toml`` in its folder.

It says what is estimated from the rows, how each section shows them, and by what each claim of the thesis is judged.
Texts hold what was found, by name and with the form of a number, as of :meth:`str.format`: ``lost: {drop:.2f}``,
``{success:.1%}`` (:class:`~.verdict.Interval`). Line breaks in them are spaces.
"""

import re
import tomllib
from collections.abc import Callable, Mapping
from importlib import resources
from typing import Any

import msgspec

from pneumarm.experiments.verdict import Criterion


class Quantity(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A figure of the rows, or by how much it differs; see :func:`~.means.estimate`."""

    figure: str
    """Its name in the rows."""
    less: str | None = None
    """Figure of the same row that is subtracted."""
    base: str | int | None = None
    """Trial that is subtracted, within runs: by name, or by number, negative from the last."""
    percent: bool = False
    """Whether what is subtracted is what the difference is given in percent of."""
    share: bool = False
    """Whether each row is a yes (1) or a no (0), as of an agent that met the criterion."""
    factor: float = 1.0
    """Multiplies the values."""


class TrialQuantity(Quantity, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A quantity in one trial, or in each."""

    trial: str | int | None = None
    """Name of the trial, or its number, negative from the last; None for every trial but the base."""


class Column(Quantity, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A quantity of all trials, shown in a table or a picture."""

    words: str
    """What people call it, with its unit."""
    digits: int = 2
    thesis: Mapping[str, float] | None = None
    """What the thesis has, by the words of the trial."""


class ClaimWords(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Something that the thesis says, and by what it is judged."""

    claim: str
    thesis: str
    """The thesis' evidence."""
    ours: str
    stated: Criterion
    """What is stated of it before any row is computed."""


class SectionWords(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A section of the page: a table of trials by columns, and a picture of them where it has a caption."""

    title: str
    text: tuple[str, ...] = ()
    trials: str = ""
    """Regular expression found in the names of the trials that are shown; by default all are."""
    called: str | None = None
    """Replaces in these names what the expression matches."""
    columns: tuple[Column, ...] = ()
    """Columns of its table; the file may name those of ``columns.toml``."""
    table: str = ""
    """Caption of its table."""
    figure: str = ""
    """Caption of its figure: the columns against the experiment's axis, or dots."""
    compared: bool = True
    """Whether the thesis' numbers are drawn too."""
    dots: tuple[str | Column, ...] = ()
    """What is drawn as dots, a line a trial: columns of the table by their figure, or others."""
    reference: int | None = None
    """Place of the trial that the others are compared with in the dots."""
    results: str = "ours"
    """Where the columns are in the results for programs."""

    @property
    def drawn(self) -> tuple[Column, ...]:
        """Return the columns that are drawn as dots."""
        known = {column.figure: column for column in self.columns}
        return tuple(known[one] if isinstance(one, str) else one for one in self.dots)


class Words(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What an experiment says, besides numbers."""

    title: str
    question: str
    """A sentence."""
    source: str
    """Where in the thesis."""
    summary: tuple[str, ...] = ()
    """Paragraphs after the question."""
    estimates: Mapping[str, TrialQuantity] = {}
    """What texts name and claims are judged by."""
    results: Mapping[str, Quantity] = {}
    """What programs get of every trial, in place of the columns."""
    sections: tuple[SectionWords, ...] = ()
    claims: Mapping[str, tuple[ClaimWords, ...]] = {}
    """By the conclusion that they are about (:attr:`~.experiment.Claim.about`)."""

    def filled(self, found: Mapping[str, Any]) -> "Words":
        """Return the words with what was ``found`` in its places; claims on what is None are left out."""
        known = {name: value for name, value in found.items() if value is not None}
        words: dict[str, Any] = msgspec.to_builtins(self)
        missing = found.keys() - known.keys()
        for about, claims in self.claims.items():
            words["claims"][about] = [
                msgspec.to_builtins(claim) for claim in claims if not missing.intersection(claim.stated.names)
            ]
        return msgspec.convert(_changed(words, lambda text: text.format_map(known)), Words)


def _changed(words: Any, change: Callable[[str], str]) -> Any:
    """Return ``words``, texts at any depth, with each text changed."""
    if isinstance(words, str):
        return change(words)
    if isinstance(words, dict):
        return {name: _changed(value, change) for name, value in words.items()}
    return [_changed(value, change) for value in words] if isinstance(words, list | tuple) else words


def words_of(package: str | None) -> Words:
    """Return the words in the file ``words.toml`` of a ``package``."""
    words, known = (
        tomllib.loads((resources.files(place) / name).read_text(encoding="utf-8"))
        for place, name in ((package or "", "words.toml"), (__package__, "columns.toml"))
    )
    for section in words.get("sections", ()):
        section["columns"] = [known[one] if isinstance(one, str) else one for one in section.get("columns", ())]
    return msgspec.convert(_changed(words, lambda one: re.sub(r"\n\s*", " ", one)), Words)
