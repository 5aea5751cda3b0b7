"""An arm that moves by itself, as recorded, with the angle that was asked for beside it: a picture that plays."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.report.colours import DARK, INK, LIGHT, MIDDLE

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Layout:
    """Where things are in the picture."""

    width: int
    height: int
    pivot: tuple[int, int]
    link: int
    """Of the arm, all links together."""
    left: int
    """Of the curve, as are the next three."""
    right: int
    top: int
    bottom: int


_WIDE = _Layout(720, 300, pivot=(130, 70), link=150, left=320, right=700, top=30, bottom=250)
_NARROW = _Layout(360, 410, pivot=(180, 30), link=135, left=42, right=350, top=200, bottom=360)
_NAMES = 56  # beside the curves, for the names of several joints
_APART = 18.0  # of two names
_FRAMES_A_SECOND = 15
_COLORS = {
    "paper": ("fill", "#ffffff", "#0f1418"),
    "words": ("fill", INK, "#e7ebee"),
    "ink": ("stroke", INK, "#e7ebee"),
    "arm": ("stroke", DARK, "#7fbfee"),
    "asked": ("stroke", MIDDLE, "#ff9560"),
    "goal": ("stroke", LIGHT, "#7a6128"),
}
"""What has a color: whether lines or areas have it, and what it is on light and on dark screens."""


def moving_arm(
    time: Array, angle: Array, wanted: Array | None, spec: ArmSpec, *, dashed: str = "asked for", narrow: bool = False
) -> str:
    """Return an SVG that plays the record for ever, in light or dark as the screen is.

    Args:
        time: of the readings, shape (n,) [s].
        angle: shape (n, joints) [counts].
        wanted: what was asked for, shape (n, joints) [counts]; None where nothing was.
        spec: the arm, for units.
        dashed: what ``wanted`` is.
        narrow: draw the arm above the curve, for the width of a phone.

    """
    at = _NARROW if narrow else _WIDE
    known = wanted is not None and bool(np.isfinite(wanted).all())
    asked = wanted if wanted is not None and known else angle
    seconds = float(time[-1] - time[0])
    grid = np.linspace(0.0, seconds, max(round(seconds * _FRAMES_A_SECOND), 2))
    degrees, goals = (
        np.stack([np.interp(grid, time - time[0], column) for column in spec.degrees(values).T], axis=1)
        for values in (angle, asked)
    )
    low, high = min(degrees.min(), goals.min()) - 3, max(degrees.max(), goals.max()) + 3
    joints = degrees.shape[1]
    right = at.right if joints == 1 else at.right - _NAMES
    x = at.left + (right - at.left) * grid / seconds

    def height(values: Array) -> Array:
        return at.bottom - (at.bottom - at.top) * (values - low) / (high - low)

    def line(values: Array, style: str) -> str:
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, height(values), strict=True))
        return f'<polyline points="{points}" fill="none" stroke-width="2" {style}/>'

    curves = "".join(
        (line(goals[:, j], 'class="asked" stroke-dasharray="6 4"') if known else "")
        + line(degrees[:, j], 'class="arm"')
        for j in range(joints)
    )
    cursor = _animated("x1", x, seconds) + _animated("x2", x, seconds)
    ticks = "".join(
        f'<text x="{at.left - 6}" y="{height(tick) + 4:.1f}" text-anchor="end">{tick:g}°</text>'.replace(">-", ">−")
        for tick in np.array(_ticks(low, high))
    )
    names = "".join(
        f'<text x="{right + 8}" y="{y + 4:.1f}">joint {joint + 1}</text>'
        for joint, y in enumerate(_spread(height(degrees[-1])) if joints > 1 else ())
    )
    links = _links(goals, seconds, at, 'class="goal" stroke-width="14"') if known else ""
    links += _links(degrees, seconds, at, 'class="arm" stroke-width="7"')
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="pneumarm" viewBox="0 0 {at.width} {at.height}" '
        f'width="{at.width}" height="{at.height}" font-family="sans-serif" font-size="14">{_style()}'
        f'<rect class="paper" width="{at.width}" height="{at.height}"/><g class="words">'
        f'<path class="ink" d="M{at.pivot[0] - 60} {at.pivot[1] - 8}h120" stroke-width="3"/>{links}'
        f'<path class="ink" d="M{at.left} {at.top}V{at.bottom}H{right}" fill="none"/>{ticks}{curves}{names}'
        f'<line class="ink" y1="{at.top}" y2="{at.bottom}">{cursor}</line>'
        f'<text x="{right}" y="{at.bottom + 18}" text-anchor="end">{seconds:.0f} s</text>'
        f'<text x="{at.left}" y="{at.bottom + 36}">{f"dashed: {dashed}; solid: the arm" if known else ""}</text>'
        "</g></svg>"
    )


def _style() -> str:
    """Return the colors as a style sheet; it names the picture, because in a notebook it reaches the whole page."""
    light, dark = (
        "".join(f".pneumarm .{name}{{{kind}:{shades[i]}}}" for name, (kind, *shades) in _COLORS.items())
        for i in (0, 1)
    )
    return f"<style>{light}@media screen and (prefers-color-scheme:dark){{{dark}}}</style>"


def _links(degrees: Array, seconds: float, at: _Layout, style: str) -> str:
    """Return a chain of links that turn about their joints, 0 degrees hanging down."""
    joints, length = degrees.shape[1], at.link / degrees.shape[1]
    inner = ""
    for joint in reversed(range(joints)):
        turns = ";".join(f"{-value:.2f}" for value in degrees[:, joint])
        turning = (
            f'<animateTransform attributeName="transform" type="rotate" values="{turns}" dur="{seconds:.2f}s" '
            'repeatCount="indefinite"/>'
        )
        link = f'<path d="M0 0V{length:.1f}" {style} stroke-linecap="round"/>'
        end = f'<g transform="translate(0 {length:.1f})">{inner}</g>' if inner else ""
        inner = f"<g>{turning}{link}{end}</g>"
    return f'<g transform="translate({at.pivot[0]} {at.pivot[1]})">{inner}</g>'


def _spread(heights: Array) -> Array:
    """Return the ``heights`` of names, moved down where one would be written over another."""
    order, spread = np.argsort(heights), heights.copy()
    for above, below in pairwise(order):
        spread[below] = max(spread[below], spread[above] + _APART)
    return spread


def _animated(name: str, values: Array, seconds: float) -> str:
    places = ";".join(f"{value:.1f}" for value in values)
    return f'<animate attributeName="{name}" values="{places}" dur="{seconds:.2f}s" repeatCount="indefinite"/>'


def _ticks(low: float, high: float) -> list[float]:
    step = next(one for one in (5, 10, 20, 30, 60, 90) if (high - low) / one <= 8 or one == 90)
    return [float(tick) for tick in np.arange(np.ceil(low / step) * step, high, step)]


def moving_arm_alt(
    time: Array, angle: Array, wanted: Array | None, spec: ArmSpec, *, dashed: str = "asked for"
) -> str:
    """Return in words what the picture shows."""
    degrees = spec.degrees(angle)
    words = (
        f"{time[-1] - time[0]:.0f} seconds of movement between {degrees.min():.0f} and {degrees.max():.0f} degrees"
    ).replace("-", "−")
    if wanted is None:
        return f"{words}."
    off = np.abs(degrees - spec.degrees(wanted))
    share = (off <= 1).all(axis=1).mean()
    return f"{words}; the arm is within 1 degree of what is {dashed} in {share:.0%} of the time."
