"""Two levels of help: a dozen options by ``--help``, all of them by ``--help-all``."""

import re
from collections.abc import Callable
from typing import TYPE_CHECKING

from cyclopts.help import DefaultFormatter, HelpEntry, HelpPanel, InlineText

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions

HELP, HELP_ALL, CONFIG, LOG = "--help", "--help-all", "--config", "--log"
_OPTIONS = "Parameters"
"""Title of the panel of a command's options."""
_EMPTY = ("()", "{}", "False")
"""Defaults that say nothing."""
_KINDS = {"PATH|SERVERADDRESS": "STORE", "STR": "TEXT"}
"""What kinds of values are called, where their names are those of types."""
_CITED = re.compile(r"\s*\(thesis[^()]*\)")
"""What cites the thesis in the words on an option."""


class AllOptions(DefaultFormatter):
    """Shows every option, the settings of each part under its name."""

    shows_parts = True

    def __call__(self, console: "Console", options: "ConsoleOptions", panel: HelpPanel) -> None:
        """Print a panel."""
        if panel.title != _OPTIONS:
            super().__call__(console, options, panel)
            return
        parts: dict[str, list[HelpEntry]] = {"": []}
        for entry in panel.entries:
            parts.setdefault(_part(entry), []).append(_plain(entry))
        parts[""] = self.shown(parts[""], len(panel.entries) - len(parts[""]))
        for part, entries in parts.items():
            if not part or self.shows_parts:
                super().__call__(console, options, panel.copy(title=part or _OPTIONS, entries=entries))

    def shown(self, entries: list[HelpEntry], others: int) -> list[HelpEntry]:
        """Return what is shown of the options of a command itself, and those that every command has."""
        return [
            *entries,
            _entry(CONFIG, "Read options from a TOML file's table [COMMAND].", "FILE"),
            _entry(LOG, "What to tell: debug, info (the default) or warning.", "LEVEL"),
        ]


class FewOptions(AllOptions):
    """Leaves out the settings of parts, such as ``--servo.agents``, and of words all but what an option does."""

    shows_parts = False

    def shown(self, entries: list[HelpEntry], others: int) -> list[HelpEntry]:
        """Return what is shown of the options of a command, and how to see the ``others``."""
        more = [_entry(HELP_ALL, f"Show {others} more options: the settings of all parts.")] if others else []
        return [*super().shown([_in_short(one) for one in entries], others), *more]


def _part(entry: HelpEntry) -> str:
    """Return the part that ``entry`` is a setting of, such as servo; none for an option of the command itself."""
    part, dot, _ = entry.names[0].removeprefix("--").partition(".")
    return part if dot or entry.default == "{}" else ""


def _entry(name: str, words: str, metavar: str | None = None) -> HelpEntry:
    description = InlineText.from_format(words, format="plaintext")
    return HelpEntry(positive_names=(name,), metavar=metavar, description=description)


def _plain(entry: HelpEntry) -> HelpEntry:
    """Return ``entry`` as it reads best."""
    default = None if entry.default in _EMPTY else entry.default
    entry = entry.copy(default=default, metavar=_KINDS.get(str(entry.metavar), entry.metavar))
    return _reworded(entry, lambda text: "\n\n".join(" ".join(part.split()) for part in text.split("\n\n")))


def _in_short(entry: HelpEntry) -> HelpEntry:
    """Return ``entry`` with the first paragraph of its words, without what cites the thesis."""
    return _reworded(entry, lambda text: _CITED.sub("", text.partition("\n\n")[0]))


def _reworded(entry: HelpEntry, change: Callable[[str], str]) -> HelpEntry:
    from rich.markdown import Markdown

    words = getattr(entry.description, "primary_renderable", None)
    if isinstance(words, Markdown):
        entry.description.primary_renderable = Markdown(change(words.markup))
    return entry
