"""The words of an experiment, as data: ``words.toml`` in its folder.

Texts hold what was found, by name and with the form of a number, as of :meth:`str.format`: ``lost: {drop:.2f}``,
``{success:.1%}`` (:class:`~.differences.Interval`). Line breaks in them are spaces.
"""

import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from importlib import resources
from typing import Any

import msgspec

from pneumarm.experiments.differences import Interval, Verdict, above, all_hold, below, within
from pneumarm.experiments.experiment import Analysis, Claim
from pneumarm.experiments.means import Column
from pneumarm.report.page import Section

_RULE = re.compile(r"(\|?)(\w+)\|? ([<>]) (-?[\d.]+)")


class ClaimWords(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Something that the thesis says, and by what it is judged."""

    about: str
    """See :attr:`~.experiment.Claim.about`."""
    claim: str
    thesis: str
    """Its evidence."""
    ours: str
    holds: str
    """When it holds: ``drop > 15``, ``drop < 0``, ``|drop| < 3``, several with ``and``; or the name of a verdict that
    was found. It is open while a 95 % interval allows both."""

    def judged(self, found: Mapping[str, Any]) -> Claim:
        """Return the claim with the verdict that what was ``found`` allows."""
        verdict: Verdict | None = found.get(self.holds)
        if verdict is None:
            verdict = all_hold([_verdict(rule, found) for rule in self.holds.split(" and ")])
        return Claim(self.claim, self.thesis, self.ours, verdict, self.about)


def _verdict(rule: str, found: Mapping[str, Any]) -> Verdict:
    parts = _RULE.fullmatch(rule)
    if parts is None:
        raise ValueError(f"{rule!r}: expected a rule such as 'drop > 15' or '|drop| < 3'")
    interval: Interval = found[parts[2]]
    if parts[1]:
        return within(interval, float(parts[4]))
    return (above if parts[3] == ">" else below)(interval, float(parts[4]))


class SectionWords(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A section of the page."""

    title: str
    text: tuple[str, ...] = ()
    columns: tuple[Column, ...] = ()
    """Of its table."""
    table: str = ""
    """Caption of its table."""
    figure: str = ""
    """Caption of its figure."""


class Words(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What an experiment says, besides numbers."""

    title: str
    question: str
    """A sentence."""
    source: str
    """Where in the thesis."""
    summary: tuple[str, ...] = ()
    """Paragraphs after the question."""
    sections: tuple[SectionWords, ...] = ()
    claims: tuple[ClaimWords, ...] = ()

    @property
    def columns(self) -> list[Column]:
        """Columns of all sections."""
        return [column for section in self.sections for column in section.columns]

    def filled(self, found: Mapping[str, Any]) -> "Words":
        """Return the words with what was ``found`` in its places; claims on what is None are left out."""
        known = {name: value for name, value in found.items() if value is not None}
        words: dict[str, Any] = msgspec.to_builtins(self)
        missing = found.keys() - known.keys()
        words["claims"] = [claim for claim in words["claims"] if claim["holds"].split()[0] not in missing]
        return msgspec.convert(_changed(words, lambda text: text.format_map(known)), Words)

    def analysis(self, found: Mapping[str, Any], figures: Mapping[str, Any], sections: Sequence[Section]) -> Analysis:
        """Return what an experiment says in these words, which are filled already."""
        claims = [claim.judged(found) for claim in self.claims]
        return Analysis([self.question, *self.summary], figures, sections, claims)


def _changed(words: Any, change: Callable[[str], str]) -> Any:
    """Return ``words``, texts at any depth, with each text changed."""
    if isinstance(words, str):
        return change(words)
    if isinstance(words, dict):
        return {name: _changed(value, change) for name, value in words.items()}
    return [_changed(value, change) for value in words] if isinstance(words, list | tuple) else words


def words_of(package: str | None) -> Words:
    """Return the words in the file ``words.toml`` of a ``package``."""
    text = (resources.files(package or "") / "words.toml").read_text(encoding="utf-8")
    return msgspec.convert(_changed(tomllib.loads(text), lambda one: " ".join(one.split())), Words)
