"""Pictures of verdicts as SVG: a dot a conclusion, and the intervals of its claims beside what was stated of them."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from html import escape

from pneumarm.drawing.colours import DARK, GREY, INK, LIGHT, MIDDLE
from pneumarm.experiments.claims import Judged
from pneumarm.experiments.experiment import Claim
from pneumarm.experiments.verdict import OPEN, Interval, Verdict

COLOURS: dict[Verdict, str] = {"holds": DARK, "in part": LIGHT, "does not hold": MIDDLE, OPEN: GREY}
"""They differ in lightness too."""
_WIDTH, _COLUMNS, _LINE, _TOP = 760, 3, 17, 46
_LEFT, _PLOT, _PART, _WORDS = 190, 330, 46, 29  # of a strip: its axis begins, is as wide, lines and letters of labels
_MARGIN = 0.08  # of an axis, at both ends
_DIGITS = 3


def overview(judged: Sequence[Judged], page: str) -> str:
    """Return a chart of a dot a conclusion, coloured by its verdict; each is a link to its place on ``page``."""
    lines = -(-len(judged) // _COLUMNS)
    counts = Counter(each.verdict for each in judged)
    body = []
    for place, (verdict, colour) in enumerate((v, c) for v, c in COLOURS.items() if counts[v]):
        x = 10 + place * _WIDTH / len(COLOURS)
        body += [_dot(x, 16, colour), _text(x + 11, 20, f"{verdict}: {counts[verdict]}", "bold")]
    for place, each in enumerate(judged):
        column, line = divmod(place, lines)
        x, y = 10 + column * _WIDTH / _COLUMNS, _TOP + _LINE * line
        of = each.conclusion
        words, label = f"{of.says} {each.verdict.capitalize()}.", f"{of.key.replace('-', ' ')} ({of.section})"
        body.append(
            f'<a href="{page}#{of.key}" target="_top"><title>{escape(words)}</title>'
            f"{_dot(x, y, COLOURS[each.verdict])}{_text(x + 11, y + 4, label)}</a>"
        )
    return _svg(_TOP + _LINE * lines, body, f"{len(judged)} conclusions of the thesis by their verdict.")


def strip(judged: Judged) -> str:
    """Return the claims of a conclusion, a line a figure: the mean with its interval, the median's below.

    What is shaded lies between the bounds that were stated, so that a whole interval in it holds. Nothing where no
    claim has figures.
    """
    parts = [
        (number, claim, name, one)
        for number, (_, claim) in enumerate(judged.claims, 1)
        for name, one in claim.criterion.parts(claim.found).items()
        if one.samples
    ]
    body = [text for place, one in enumerate(parts) for text in _part(_PART * place, *one)]
    return _svg(_PART * len(parts) + 4, body, f"Claims on: {judged.conclusion.says}") if parts else ""


def _part(y: float, number: int, claim: Claim, name: str, one: Interval) -> Iterator[str]:
    bounds, colour = claim.criterion.bounds, COLOURS[claim.verdict]
    drawn = {"mean": one} | ({"median": one.median} if one.median else {})
    halves = {which: each.half if math.isfinite(each.half) else 0.0 for which, each in drawn.items()}
    ends = [x for x in (*bounds, *claim.criterion.refuting) if math.isfinite(x)]
    ends += [each.mean + sign * halves[which] for which, each in drawn.items() for sign in (-1, 1)]
    low, high = min(ends), max(ends)
    margin = _MARGIN * (high - low or abs(high) or 1)

    def at(x: float) -> float:
        share = (x - low + margin) / (high - low + 2 * margin)
        return round(_LEFT + _PLOT * min(max(share, 0), 1), 2)

    left, right = (at(x) for x in bounds)
    named = f"{number}" if len(claim.criterion.parts(claim.found)) == 1 else f"{number} {name}"
    yield f'<g data-claim="{number}" data-verdict="{claim.verdict}">'
    yield _text(4, y + 20, named if len(named) < _WORDS else f"{named[: _WORDS - 2]}…")
    yield f'<rect x="{left}" y="{y + 4}" width="{round(right - left, 2)}" height="26" fill="#dbe8f0"/>'
    for which, each in drawn.items():
        where, fill = (y + 12, colour) if which == "mean" else (y + 23, "white")
        x1, x2 = at(each.mean - halves[which]), at(each.mean + halves[which])
        yield _line(x1, where, x2, where, f'class="{which}" stroke="{colour}" stroke-width="2"')
        yield f'<circle cx="{at(each.mean)}" cy="{where}" r="4" fill="{fill}" stroke="{colour}"/>'
        yield _text(_LEFT + _PLOT + 10, where + 4, f"{which} {number_of(each.mean, halves[which])}")
    for x in bounds:
        if math.isfinite(x):
            yield _line(at(x), y + 2, at(x), y + 32, f'stroke="{INK}" stroke-dasharray="3 2"')
            yield _text(at(x) - 3, y + 42, f"{x:g}".replace("-", "−"))
    yield "</g>"


def number_of(mean: float, half: float) -> str:
    """Return a mean with half its interval, 0 where it has none, to three digits of the larger."""
    largest = max(abs(mean), half)
    digits = max(0, _DIGITS - 1 - math.floor(math.log10(largest))) if largest else 1
    return f"{mean:+z,.{digits}f}".replace("-", "−") + (f" ± {half:,.{digits}f}" if half else "")


def _line(x1: float, y1: float, x2: float, y2: float, style: str) -> str:
    return f'<line x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}" {style}/>'


def _dot(x: float, y: float, colour: str) -> str:
    return f'<circle cx="{x:.0f}" cy="{y:.0f}" r="6" fill="{colour}" stroke="{INK}" stroke-width="0.6"/>'


def _text(x: float, y: float, words: str, weight: str = "normal") -> str:
    return f'<text x="{x:g}" y="{y:g}" font-weight="{weight}">{escape(words)}</text>'


def _svg(height: float, body: Sequence[str], words: str) -> str:
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" width="{_WIDTH}" role="img"'
            f' font-family="sans-serif" font-size="12" fill="{INK}"><title>{escape(words)}</title>',
            f'<rect width="{_WIDTH}" height="{height}" fill="white"/>',
            *body,
            "</svg>\n",
        ]
    )
