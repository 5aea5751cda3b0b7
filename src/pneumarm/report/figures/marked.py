"""Which of the stored rows are marked, so that nothing is learned from them, and why."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pneumarm.drawing.colours import DARK, GREY, INK
from pneumarm.report.style import Described, panels, styled

_THINNEST = 0.003  # of the width: a shorter stretch is drawn as long as this, so that it can be seen
_LINE = 34  # characters of a label in a line


@styled
def marked_rows(
    spans: NDArray[np.int64], reason: NDArray[np.int64], reasons: Sequence[str], ends: Sequence[int],
    stages: Sequence[str], period: float,
) -> Described:  # fmt: skip
    """Draw a lane a reason, with the stretches of the rows that are marked for it.

    Args:
        spans: first row and the one after the last of each stretch, in the order of recording, shape (n, 2).
        reason: index of its reason, shape (n,).
        reasons: in words.
        ends: rows recorded by the end of each stage, rising.
        stages: what was done then.
        period: of control [s].

    """
    minutes = period / 60
    total = max(ends[-1] if ends else 0, 1) * minutes
    figure, axes = panels(1, 1, 0.9 + 0.42 * max(len(reasons), 1))
    place = axes[0, 0]
    words = []
    for lane, name in enumerate(reasons):
        begin, end = (spans[reason == lane] * minutes).T
        if len(begin):
            rows = np.diff(spans[reason == lane]).sum()
            words.append(f"{name}: {rows:,} rows between {begin.min():.1f} and {end.max():.1f} min")
        width = np.maximum(end - begin, _THINNEST * total)
        place.broken_barh(list(zip(begin, width, strict=True)), (lane - 0.3, 0.6), color=DARK)
    for stage, first, end in zip(stages, [0, *ends], ends, strict=False):
        place.axvline(end * minutes, color=GREY, ls=":", lw=1.2)
        place.text(
            (first + end) / 2 * minutes, 1.02, stage, transform=place.get_xaxis_transform(), ha="center", color=INK
        )
    place.set_yticks(range(len(reasons)), [_folded(one) for one in reasons])
    place.set_ylim(max(len(reasons), 1) - 0.5, -0.5)
    place.set_ylabel("marked for")
    place.set_xlim(0, total)
    place.grid(visible=False, axis="y")
    place.set_xlabel("recorded until then [min]")
    figure.alt = f"Marked rows. {'; '.join(words)}." if words else "No rows are marked."
    return figure


def _folded(words: str) -> str:
    """Return ``words`` in lines that fit beside the lanes."""
    lines = [""]
    for word in words.split():
        if lines[-1] and len(lines[-1]) + len(word) >= _LINE:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return "\n".join(lines)
