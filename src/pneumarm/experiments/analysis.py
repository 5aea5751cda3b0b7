"""What the rows of an experiment say, by its words: estimates, sections with tables and pictures, judged claims.

An experiment that needs something of its own has a module ``analysis`` in its folder, which adds it to them.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from pneumarm.experiments.experiment import Analysis, Experiment, TrialRows, claims_of
from pneumarm.experiments.means import estimate, means_table, numbers
from pneumarm.experiments.pictures import against, dots
from pneumarm.experiments.verdict import Interval
from pneumarm.experiments.words import Quantity, SectionWords, Words
from pneumarm.report.page import Picture, Section, Table


def analysis(experiment: Experiment, rows: TrialRows) -> Analysis:
    """Return what the rows say by the words alone."""
    return analysed(experiment, rows, *filled_words(experiment, rows))


class ByTrial(dict[str, Interval]):
    """A quantity of all trials by their names."""

    def __format__(self, form: str) -> str:
        """Return it for people, with the form of every number."""
        return "; ".join(f"{trial}: {found:{form}}" for trial, found in self.items())


def filled_words(experiment: Experiment, rows: TrialRows, **own: Any) -> tuple[Words, dict[str, Any]]:
    """Return the words with what was found in their places, and what was found: what they estimate and ``own``."""
    words = experiment.words
    found: dict[str, Any] = {name: by_trial(experiment, rows, what) for name, what in words.results.items()}
    found |= {
        name: by_trial(experiment, rows, one)
        if one.trial is None
        else estimate(rows, one, number(experiment, one.trial), number(experiment, one.base))
        for name, one in words.estimates.items()
    }
    return words.filled(found | own), found | own


def number(experiment: Experiment, trial: str | int | None) -> Any:
    """Return the number of a trial that is given by name, or by number, negative from the last; None of None."""
    if isinstance(trial, str):
        return {name: number for number, name in experiment.trials.items()}[trial]
    return trial if trial is None or trial > 0 else list(experiment.trials)[trial]


def by_trial(experiment: Experiment, rows: TrialRows, quantity: Quantity) -> ByTrial:
    """Return ``quantity`` in every trial but its base."""
    base = number(experiment, quantity.base)
    return ByTrial({name: estimate(rows, quantity, t, base) for t, name in experiment.trials.items() if t != base})


def analysed(
    experiment: Experiment,
    rows: TrialRows,
    words: Words,
    found: Mapping[str, Any],
    *,
    figures: Mapping[str, Any] | None = None,
    pictures: Mapping[int, Sequence[Picture]] | None = None,
    tables: Mapping[int, Sequence[Table]] | None = None,
) -> Analysis:
    """Return what an experiment says.

    Args:
        experiment: any.
        rows: of all arms.
        words: filled with what was found.
        found: what claims are judged by.
        figures: for programs; by default the quantities that the words name, or else the columns of all sections.
        pictures: of sections, by place, in place of those that the words ask for.
        tables: of sections, by place, after those that the words ask for.

    """
    if figures is None:
        named = {name: {t: one.figures() for t, one in found[name].items()} for name in words.results}
        figures = named or _columns(experiment, rows, words)
    sections = []
    for place, section in enumerate(words.sections):
        trials = shown_trials(experiment, section)
        made = (
            [means_table(rows, trials, section.columns, section.table)] if section.table and section.columns else []
        )
        drawn = (pictures or {}).get(place) or _drawn(experiment, rows, section, trials)
        sections.append(Section(section.title, section.text, drawn, [*made, *(tables or {}).get(place, ())]))
    return Analysis([words.question, *words.summary], figures, sections, claims_of(words, found))


def shown_trials(experiment: Experiment, section: SectionWords, *, called: bool = True) -> dict[int, str]:
    """Return the trials of a section, as they are ``called`` there or by their names."""
    name = section.called if called else None
    return {
        trial: words if name is None else re.sub(section.trials, name, words)
        for trial, words in experiment.trials.items()
        if re.search(section.trials, words)
    }


def _columns(experiment: Experiment, rows: TrialRows, words: Words) -> dict[str, Any]:
    """Return the means of all columns by trial, for programs."""
    made: dict[str, Any] = {}
    for section in words.sections:
        of_section = made.setdefault(section.results, {})
        for figure, means in numbers(rows, shown_trials(experiment, section, called=False), section.columns).items():
            of_section.setdefault(figure, {}).update(means)
    return made


def _drawn(
    experiment: Experiment, rows: TrialRows, section: SectionWords, trials: Mapping[int, str]
) -> list[Picture]:
    """Return the columns of a section against the experiment's axis, or as dots."""
    if section.dots:
        quantities = {one.words: [estimate(rows, one, trial) for trial in trials] for one in section.drawn}
        return [dots(list(trials.values()), quantities, section.figure, reference=section.reference)]
    axis = experiment.axis
    if axis is None or not section.figure or not section.columns:
        return []
    columns = [c if section.compared else msgspec.structs.replace(c, thesis=None) for c in section.columns]
    first = dict(list(trials.items())[: len(axis.places)])
    return [against(rows, first, axis, columns, section.figure)]
