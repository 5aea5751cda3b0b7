"""The page of the errors of appendix A: what happened, what is said of it, and the pictures that reveal it."""

from collections.abc import Sequence

from pneumarm.appendix_a.playing_errors import PlayedError
from pneumarm.appendix_a.runs import Case
from pneumarm.report.page import Picture, Section, Table, render
from pneumarm.report.style import quantities


def errors_page(errors: Sequence[PlayedError], arm: str) -> str:
    """Return the page of the ``errors`` of ``arm`` as HTML text."""
    summary = [
        f"The errors that appendix A of the thesis tells of, played on {arm}: the same commands to the same arm "
        "without and with each error, the picture that reveals it, and what check-up and monitor say of it in words.",
        "Simulations are fitted to what was recorded with the error, and shown on sequences that were kept out of "
        "the fit. The monitor knows the arm from before the error.",
    ]
    return render("The errors of appendix A", summary, [_section(error) for error in errors])


def _section(error: PlayedError) -> Section:
    return Section(
        error.words.title,
        text=[" ".join(error.words.happened.split())],
        tables=[verdicts(error)],
        figures=[Picture(figure, caption, f"{caption} {_errors_of(error)}") for figure, caption in error.drawn()],
    )


def verdicts(error: PlayedError) -> Table:
    """Return what is said of each case of ``error``."""
    kinds = quantities(error.cases[0].spec)
    rows = [
        (
            f"error of the simulation: {kind.name} [{kind.unit}]",
            *(f"{kind.per_count * case.residue[..., i].std():.2g}" for case in error.cases),
        )
        for i, kind in enumerate(kinds)
    ]
    rows.append(("check-up", *(_checkup(case) for case in error.cases)))
    rows.append(("monitor", *(" ".join(case.monitor) or "nothing found" for case in error.cases)))
    header = ("", *(case.name for case in error.cases))
    return Table(header, rows, "What is said of each run.", words=True)


def _checkup(case: Case) -> str:
    if case.checkup is None:
        return "not made"
    return " ".join(case.complaints) or "nothing found"


def _errors_of(error: PlayedError) -> str:
    angle, _, pressure, _ = quantities(error.cases[0].spec)
    return "; ".join(
        f"{case.name}: error of the angle {angle.per_count * case.residue[..., 0].std():.2g}°, of pressure 1 "
        f"{pressure.per_count * case.residue[..., 2].std():.2g} bar"
        for case in error.cases
    )
