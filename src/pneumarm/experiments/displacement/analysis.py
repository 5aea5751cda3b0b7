"""What the rows say of movements by their displacement."""

from collections.abc import Sequence

import numpy as np

from pneumarm.arm import ArmSpec
from pneumarm.experiments.differences import Interval
from pneumarm.experiments.displacement.typical import AFTER, SERIES, Displacement
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.means import Column, from_series, mean, over_arms, series_of, values
from pneumarm.experiments.pictures import section
from pneumarm.experiments.words import SectionWords
from pneumarm.report.data import Demonstration
from pneumarm.report.figures import against_displacement, movement
from pneumarm.report.page import Picture, Section, Table
from pneumarm.report.thesis import GOAL_TOLERANCE

_THIRDS = (("success", 1, 100.0), ("actions", 2, 1.0), ("switches", 2, 1.0), ("ratio", 3, 1.0))
_TYPICAL = (("success", 1, 100.0), ("seconds", 2, 1.0), ("out of the way", 1, 1.0), ("ringing", 1, 1.0))


def analysis(experiment: Displacement, rows: TrialRows) -> Analysis:
    """Return the pictures of section 5.5.2 and what they say."""
    spec = ArmSpec()
    distance, actions, switches = (series_of(rows, name, 1) for name in ("distance", "actions", "switches"))
    found = measured(rows, experiment.sizes.degrees)
    small, middle, large = (f"{degrees:g}°" for degrees in experiment.sizes.degrees)
    short, long = (_degrees(mean(rows, f"{name}: out of the way", 1)) for name in (small, large))
    words = experiment.words.filled(
        {
            **found,
            "small": small,
            "middle": middle,
            "large": large,
            "short": short,
            "long": long,
            "rings": _degrees(found["ringing"]),
            "count": len(actions),
            "after": AFTER,
        }
    )
    scatter = Picture(against_displacement(distance[:, None], actions, switches, spec), words.sections[0].figure)
    names = sorted(name for name in rows.figures if "#" not in name)
    return words.analysis(
        found,
        figures={name: mean(rows, name, 1)._asdict() for name in names},
        sections=[
            section(words.sections[0], rows, {}, figures=[scatter], tables=[_thirds(words.sections[0], rows)]),
            _typical(words.sections[1], rows, spec, experiment.sizes.degrees),
        ],
    )


def measured(rows: TrialRows, displacements: Sequence[float]) -> dict[str, Interval]:
    """Return what claims are judged by; ``displacements`` are the small, the middle and the large one [degrees]."""
    small, middle, large = (f"{degrees:g}°" for degrees in displacements)

    def more(first: str, second: str) -> Interval:
        return over_arms(values(rows, first, 1) - values(rows, second, 1))

    return {
        "of_actions": mean(rows, "correlation of actions", 1),
        "of_switches": mean(rows, "correlation of switches", 1),
        "less": more("correlation of actions", "correlation of switches"),
        "ratio": more("ratio, short", "ratio, long"),
        "success": more("success, short", "success, long").times(100),
        "few": mean(rows, "few switches", 1),
        "harder": more(f"{small}: out of the way", f"{large}: out of the way"),
        "ringing": mean(rows, f"{middle}: ringing", 1),
    }


def _thirds(words: SectionWords, rows: TrialRows) -> Table:
    lines = [
        [called, *(Column(f"{name}, {key}", "", digits, factor).text(rows, 1) for name, digits, factor in _THIRDS)]
        for called, key in (("shortest third", "short"), ("longest third", "long"))
    ]
    return Table(["displacement", "success [%]", "actions", "switches", "switches an action"], lines, words.table)


def _typical(words: SectionWords, rows: TrialRows, spec: ArmSpec, displacements: Sequence[float]) -> Section:
    lines, pictures = [], []
    for degrees, figure in zip(displacements, ("5.18", "5.17", "5.19"), strict=True):
        name = f"{degrees:g}°: "
        first = next((row.figures for row in rows.rows if name + "goal" in row.figures), None)
        if first is None:
            continue
        shown = [Column(name + one, "", digits, factor).text(rows, 1) for one, digits, factor in _TYPICAL]
        lines.append([f"{degrees:g}°", *shown])
        time, angle, p1, p2, v1, v2 = (from_series(first, name + label) for label in SERIES)
        pressure, valves = (np.stack(pair, axis=-1)[:, None] for pair in ((p1, p2), (v1, v2)))
        goal, end = np.array([first[name + "goal"]]), first.get(name + "end")
        one = Demonstration(time, angle[:, None], pressure, valves, goal, end, name)
        caption = f"A movement by {degrees:g}° on {rows.rows[0].arm} (thesis figure {figure})."
        pictures.append(Picture(movement(one.shown(spec), one.seconds, tolerance=GOAL_TOLERANCE), caption))
    header = ["displacement", "success [%]", "time [s]", "out of the way [°]", "ringing [°]"]
    return section(words, rows, {}, figures=pictures, tables=[Table(header, lines, words.table)])


def _degrees(found: Interval) -> str:
    return f"{found:.1f}°" if found.samples else "no such movements"
