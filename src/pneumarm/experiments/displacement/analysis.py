"""What the rows say of movements by their displacement."""

from collections.abc import Sequence

import numpy as np

from pneumarm.arm import ArmSpec
from pneumarm.experiments.analysis import analysed, filled_words
from pneumarm.experiments.displacement.typical import AFTER, SERIES, Displacement
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.means import estimate, from_series, mean, series_of
from pneumarm.experiments.verdict import Interval
from pneumarm.experiments.words import Quantity
from pneumarm.report.data import Demonstration
from pneumarm.report.figures.displacement import against_displacement
from pneumarm.report.figures.film import movement
from pneumarm.report.page import Picture, Table
from pneumarm.report.thesis import GOAL_TOLERANCE

_THIRDS = (("success", 1, 100.0), ("actions", 2, 1.0), ("switches", 2, 1.0), ("ratio", 3, 1.0))
_TYPICAL = (("success", 1, 100.0), ("seconds", 2, 1.0), ("out of the way", 1, 1.0), ("ringing", 1, 1.0))


def analysis(experiment: Displacement, rows: TrialRows) -> Analysis:
    """Return the pictures of section 5.5.2 and what they say."""
    spec, displacements = ArmSpec(), experiment.sizes.degrees
    distance, actions, switches = (series_of(rows, name, 1) for name in ("distance", "actions", "switches"))
    small, middle, large = (f"{degrees:g}°" for degrees in displacements)
    out = {name: f"{name}: out of the way" for name in (small, large)}
    ringing = mean(rows, f"{middle}: ringing", 1)
    words, found = filled_words(
        experiment,
        rows,
        harder=estimate(rows, Quantity(figure=out[small], less=out[large]), 1),
        ringing=ringing,
        small=small,
        middle=middle,
        large=large,
        short=_degrees(mean(rows, out[small], 1)),
        long=_degrees(mean(rows, out[large], 1)),
        rings=_degrees(ringing),
        count=len(actions),
        after=AFTER,
    )
    scatter = Picture(against_displacement(distance[:, None], actions, switches, spec), words.sections[0].figure)
    typical, pictures = _typical(rows, spec, displacements, words.sections[1].table)
    return analysed(
        experiment,
        rows,
        words,
        found,
        figures={name: mean(rows, name, 1).figures() for name in sorted(rows.figures) if "#" not in name},
        pictures={0: [scatter], 1: pictures},
        tables={0: [_thirds(rows, words.sections[0].table)], 1: [typical]},
    )


def _thirds(rows: TrialRows, caption: str) -> Table:
    lines = [
        [called, *(_mean(rows, f"{name}, {key}", digits, factor) for name, digits, factor in _THIRDS)]
        for called, key in (("shortest third", "short"), ("longest third", "long"))
    ]
    return Table(["displacement", "success [%]", "actions", "switches", "switches an action"], lines, caption)


def _typical(
    rows: TrialRows, spec: ArmSpec, displacements: Sequence[float], caption: str
) -> tuple[Table, list[Picture]]:
    lines, pictures = [], []
    for degrees, figure in zip(displacements, ("5.18", "5.17", "5.19"), strict=True):
        name = f"{degrees:g}°: "
        first = next((row.figures for row in rows.rows if name + "goal" in row.figures), None)
        if first is None:
            continue
        means = [_mean(rows, name + one, digits, factor) for one, digits, factor in _TYPICAL]
        lines.append([f"{degrees:g}°", *means])
        time, angle, p1, p2, v1, v2 = (from_series(first, name + label) for label in SERIES)
        pressure, valves = (np.stack(pair, axis=-1)[:, None] for pair in ((p1, p2), (v1, v2)))
        goal, end = np.array([first[name + "goal"]]), first.get(name + "end")
        one = Demonstration(time, angle[:, None], pressure, valves, goal, end, name)
        caption = f"A movement by {degrees:g}° on {rows.rows[0].arm} (thesis figure {figure})."
        pictures.append(Picture(movement(one.shown(spec), one.seconds, tolerance=GOAL_TOLERANCE), caption))
    header = ["displacement", "success [%]", "time [s]", "out of the way [°]", "ringing [°]"]
    return Table(header, lines, caption), pictures


def _mean(rows: TrialRows, figure: str, digits: int, factor: float) -> str:
    return f"{estimate(rows, Quantity(figure=figure, factor=factor), 1):.{digits}f}"


def _degrees(found: Interval) -> str:
    return f"{found:.1f}°" if found.samples else "no such movements"
