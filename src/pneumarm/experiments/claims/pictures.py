"""Pictures of verdicts as SVG: a dot a conclusion, and the intervals of its claims beside what was stated of them."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from html import escape

from pneumarm.drawing.colours import DARK, GREY, INK, LIGHT, MIDDLE
from pneumarm.experiments.claims import Judged
from pneumarm.experiments.results import FoundClaim, Part
from pneumarm.experiments.verdict import OPEN, Verdict

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
        (number, claim, part)
        for number, (_, claim) in enumerate(judged.claims, 1)
        for part in claim.parts
        if part.mean is not None
    ]
    body = [text for place, one in enumerate(parts) for text in _part(_PART * place, *one)]
    return _svg(_PART * len(parts) + 4, body, f"Claims on: {judged.conclusion.says}") if parts else ""


def _part(y: float, number: int, claim: FoundClaim, part: Part) -> Iterator[str]:
    bounds = claim.criterion.bounds
    spans = [span for span in (_span((part.mean, part.half)), part.median and _span(part.median)) if span]
    ends = [x for x in (*bounds, *claim.criterion.refuting) if math.isfinite(x)] + [x for span in spans for x in span]
    low, high = min(ends), max(ends)
    margin = _MARGIN * (high - low or abs(high) or 1)

    def at(x: float) -> float:
        share = (x - low + margin) / (high - low + 2 * margin)
        return round(_LEFT + _PLOT * min(max(share, 0), 1), 2)

    left, right = (at(x) for x in bounds)
    named = f"{number}" if len(claim.parts) == 1 else f"{number} {part.name}"
    yield f'<g data-claim="{number}" data-verdict="{claim.verdict}">'
    yield _text(4, y + 20, named if len(named) < _WORDS else f"{named[: _WORDS - 2]}…")
    yield f'<rect x="{left}" y="{y + 4}" width="{round(right - left, 2)}" height="26" fill="#dbe8f0"/>'
    colour = COLOURS[claim.verdict]
    for name, pair, where in (("mean", (part.mean, part.half), y + 12), ("median", part.median, y + 23)):
        if not pair or (span := _span(pair)) is None or pair[0] is None:
            continue
        x1, x2 = (at(x) for x in span)
        fill = colour if name == "mean" else "white"
        yield _line(x1, where, x2, where, f'class="{name}" stroke="{colour}" stroke-width="2"')
        yield f'<circle cx="{at(pair[0])}" cy="{where}" r="4" fill="{fill}" stroke="{colour}"/>'
        yield _text(_LEFT + _PLOT + 10, where + 4, f"{name} {number_of(*pair)}")
    for x in bounds:
        if math.isfinite(x):
            yield _line(at(x), y + 2, at(x), y + 32, f'stroke="{INK}" stroke-dasharray="3 2"')
            yield _text(at(x) - 3, y + 42, f"{x:g}".replace("-", "−"))
    yield "</g>"


def _span(pair: tuple[float | None, float | None]) -> tuple[float, float] | None:
    """Return the ends of a mean with half its interval, the mean alone where it has none."""
    mean, half = pair
    return None if mean is None else (mean - (half or 0), mean + (half or 0))


def number_of(mean: float | None, half: float | None) -> str:
    """Return a mean with half its interval, to three digits of the larger."""
    if mean is None:
        return "none"
    largest = max(abs(mean), half or 0)
    digits = max(0, _DIGITS - 1 - math.floor(math.log10(largest))) if largest else 1
    said = f"{mean:+z,.{digits}f}" + ("" if half is None else f" ± {half:,.{digits}f}")
    return said.replace("-", "−")


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
