"""Two levels of help: a dozen options by ``--help``, all of them by ``--help-all``."""

import re
from typing import TYPE_CHECKING

from cyclopts.help import DefaultFormatter, HelpEntry, HelpPanel, InlineText

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions

HELP, HELP_ALL, CONFIG, LOG = "--help", "--help-all", "--config", "--log"
_OPTIONS = "Parameters"
"""Title of the panel of a command's options."""
_EMPTY = ("()", "{}")
"""Defaults that say nothing."""
_KINDS = {"PATH|SERVERADDRESS": "STORE", "STR": "TEXT"}
"""What kinds of values are called, where their names are those of types."""
_CITED = re.compile(r"\s*\(thesis[^()]*\)")
"""What cites the thesis in the words on an option."""


class AllOptions(DefaultFormatter):
    """Shows every option."""

    def __call__(self, console: "Console", options: "ConsoleOptions", panel: HelpPanel) -> None:
        """Print a panel."""
        if panel.title == _OPTIONS:
            panel = panel.copy(entries=self.shown([_plain(one) for one in panel.entries]))
        super().__call__(console, options, panel)

    def shown(self, entries: list[HelpEntry]) -> list[HelpEntry]:
        """Return what is shown of the options of a command: all, and those that every command has."""
        return [
            *entries,
            _entry(CONFIG, "Read options from the table [COMMAND] of this TOML file.", "FILE"),
            _entry(LOG, "What to say on progress: debug, info (the default) or warning.", "LEVEL"),
        ]


class FewOptions(AllOptions):
    """Leaves out the settings of parts, such as ``--servo.agents``, and of words all but what an option does."""

    def shown(self, entries: list[HelpEntry]) -> list[HelpEntry]:
        """Return what is shown of the options of a command, and how to see the others."""
        kept = [_in_short(one) for one in entries if not any("." in name for name in one.names)]
        left_out = len(entries) - len(kept)
        more = [_entry(HELP_ALL, f"Show {left_out} more options: the settings of all parts.")] if left_out else []
        return [*super().shown(kept), *more]


def _entry(name: str, words: str, metavar: str | None = None) -> HelpEntry:
    description = InlineText.from_format(words, format="plaintext")
    return HelpEntry(positive_names=(name,), metavar=metavar, description=description)


def _plain(entry: HelpEntry) -> HelpEntry:
    """Return ``entry`` as it reads best."""
    default = None if entry.default in _EMPTY else entry.default
    return entry.copy(default=default, metavar=_KINDS.get(str(entry.metavar), entry.metavar))


def _in_short(entry: HelpEntry) -> HelpEntry:
    """Return ``entry`` with the first paragraph of its words, without what cites the thesis."""
    from rich.markdown import Markdown

    words = getattr(entry.description, "primary_renderable", None)
    if isinstance(words, Markdown):
        entry.description.primary_renderable = Markdown(_CITED.sub("", words.markup.partition("\n\n")[0]))
    return entry
