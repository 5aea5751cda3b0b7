"""An arm that moves by itself, as recorded, with the angle that was asked for beside it: a picture that plays."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.report.style import DARK, INK, LIGHT, MIDDLE

Array = NDArray[np.float64]

_WIDTH, _HEIGHT = 720, 300
_PIVOT, _LINK = (130, 70), 150  # of the arm, all links together
_LEFT, _RIGHT, _TOP, _BOTTOM = 320, 700, 30, 250  # of the curve
_NAMES = 52  # beside the curves, for the names of several joints
_APART = 16.0  # of two names
_FRAMES_A_SECOND = 15


def moving_arm(time: Array, angle: Array, wanted: Array | None, spec: ArmSpec) -> str:
    """Return an SVG that plays the record for ever.

    Args:
        time: of the readings, shape (n,) [s].
        angle: shape (n, joints) [counts].
        wanted: what was asked for, shape (n, joints) [counts]; None where nothing was.
        spec: the arm, for units.

    """
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
    right = _RIGHT if joints == 1 else _RIGHT - _NAMES
    x = _LEFT + (right - _LEFT) * grid / seconds

    def height(values: Array) -> Array:
        return _BOTTOM - (_BOTTOM - _TOP) * (values - low) / (high - low)

    def line(values: Array, style: str) -> str:
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, height(values), strict=True))
        return f'<polyline points="{points}" fill="none" {style}/>'

    curves = "".join(
        (line(goals[:, j], f'stroke="{MIDDLE}" stroke-width="2" stroke-dasharray="6 4"') if known else "")
        + line(degrees[:, j], f'stroke="{DARK}" stroke-width="2"')
        for j in range(joints)
    )
    cursor = _animated("x1", x, seconds) + _animated("x2", x, seconds)
    ticks = "".join(
        f'<text x="{_LEFT - 8}" y="{height(tick) + 4:.1f}" text-anchor="end">{f"{tick:g}°".replace("-", "−")}</text>'
        for tick in np.array(_ticks(low, high))
    )
    names = "".join(
        f'<text x="{right + 8}" y="{y + 4:.1f}">joint {joint + 1}</text>'
        for joint, y in enumerate(_spread(height(degrees[-1])) if joints > 1 else ())
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}" width="{_WIDTH}" '
        f'height="{_HEIGHT}" font-family="sans-serif" font-size="13" fill="{INK}">'
        f'<rect width="{_WIDTH}" height="{_HEIGHT}" fill="white"/>'
        f'<path d="M{_PIVOT[0] - 60} {_PIVOT[1] - 8}h120" stroke="{INK}" stroke-width="3"/>'
        f"{_links(goals, seconds, f'stroke={chr(34)}{LIGHT}{chr(34)} stroke-width={chr(34)}14{chr(34)}')}"
        f"{_links(degrees, seconds, f'stroke={chr(34)}{DARK}{chr(34)} stroke-width={chr(34)}7{chr(34)}')}"
        f'<path d="M{_LEFT} {_TOP}V{_BOTTOM}H{right}" fill="none" stroke="{INK}"/>{ticks}{curves}{names}'
        f'<line y1="{_TOP}" y2="{_BOTTOM}" stroke="{INK}">{cursor}</line>'
        f'<text x="{right}" y="{_BOTTOM + 18}" text-anchor="end">{seconds:.0f} s</text>'
        f'<text x="{_LEFT}" y="{_BOTTOM + 36}">{"dashed: asked for; solid: the arm" if known else ""}</text></svg>'
    )


def _links(degrees: Array, seconds: float, style: str) -> str:
    """Return a chain of links that turn about their joints, 0 degrees hanging down."""
    joints, length = degrees.shape[1], _LINK / degrees.shape[1]
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
    return f'<g transform="translate({_PIVOT[0]} {_PIVOT[1]})">{inner}</g>'


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


def moving_arm_alt(time: Array, angle: Array, wanted: Array, spec: ArmSpec) -> str:
    """Return in words what the picture shows."""
    off = np.abs(spec.degrees(angle) - spec.degrees(wanted))
    return (
        f"{time[-1] - time[0]:.0f} seconds of movement; the arm is within 1 degree of what is asked for in "
        f"{(off <= 1).all(axis=1).mean():.0%} of the time."
    )
