"""Whoever is told and asked on a page, in a browser beside the arm."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from queue import Empty

from pneumarm.commands.asking import Bars, Meanwhile, Person, nothing
from pneumarm.console import say
from pneumarm.live.questions import QuestionPage
from pneumarm.progress import Report, progress

_TURN = 0.05  # s between two looks at the answers


class OnPage(Person):
    """Who answers on ``page``; what is said is printed, too."""

    def __init__(self, page: QuestionPage) -> None:
        self.page = page

    def say(self, text: str) -> None:
        """Print ``text``, and show it."""
        say(text)
        self.page.say(text)

    def show(self, bars: Bars) -> None:
        """Show ``bars``."""
        self.page.shown["bars"] = [list(bar) for bar in bars]

    @contextmanager
    def display(self, title: str) -> Iterator[Report]:
        """Show how far something of this title is while the block runs."""
        with progress(title) as told:

            def report(done: float, total: float) -> None:
                told(done, total)
                self.page.shown["doing"] = [title, round(done), round(total)]

            yield report

    def line(
        self, question: str, meanwhile: Meanwhile = nothing, choices: Sequence[str] = (), numbers: bool = False
    ) -> str:
        """Return what was answered on the page."""
        say(question)
        self.page.ask(question, list(choices), numbers)
        while True:
            meanwhile()
            with suppress(Empty):
                return self.page.answers.get(timeout=_TURN)
