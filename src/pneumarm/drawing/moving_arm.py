"""An arm that moves by itself, as recorded, with the angle that was asked for beside it: an SVG that plays."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.hand import link_ends
from pneumarm.arm.seam import ArmSpec
from pneumarm.drawing.drawn_arm import LOOKS, DrawnArm, Look, Muscle, Pose, Shape, air, brightness, style

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shown:
    """A stretch of ``n`` readings."""

    spec: ArmSpec
    time: Array
    """From 0, shape (n,) [s]."""
    angle: Array
    """Shape (n, joints) [counts]."""
    wanted: Array | None = None
    """What was asked for, shape (n, joints) [counts]; None where nothing was."""
    pressure: Array | None = None
    """Shape (n, joints, 2) [counts]; None where it was not kept."""
    command: Array | None = None
    """In force from each reading to the next, shape (n, joints, 2)."""

    def poses(self, times: Array) -> Pose:
        """Return what the arm did at ``times`` (m,) [s] since the first reading."""
        shape = (len(self.time), self.spec.joints, 2)
        full = (
            np.full(shape, _UNKNOWN)
            if self.pressure is None
            else self.spec.bar(self.pressure) / self.spec.max_pressure
        )
        lights = brightness(np.zeros(shape) if self.command is None else self.command)
        begin = np.clip(np.searchsorted(self.time - self.time[0], times, "right") - 1, 0, None)
        return Pose(self.at(times, self.spec.degrees(self.angle)), self.at(times, full), lights[begin])

    def at(self, times: Array, values: Array) -> Array:
        """Return ``values`` (n, ...) of the readings at ``times`` (m,) [s] since the first, shape (m, ...)."""
        flat = values.reshape(len(values), -1).T
        known = self.time - self.time[0]
        return np.stack([np.interp(times, known, one) for one in flat], axis=1).reshape(len(times), *values.shape[1:])


_UNKNOWN = 0.4  # of the highest pressure: what muscles are drawn with that nobody measured


@dataclass(frozen=True)
class _Layout:
    """Where things are in the picture."""

    width: int
    height: int
    arm: tuple[int, int, int]
    """Middle, upper and lower end of the arm."""
    left: int
    """Left end of the curve; the next three are its other ends."""
    right: int
    top: int
    bottom: int


_WIDE = _Layout(720, 300, arm=(140, 12, 288), left=320, right=700, top=30, bottom=250)
_NARROW = _Layout(360, 500, arm=(180, 8, 272), left=42, right=350, top=290, bottom=450)
_NAMES = 56  # beside the curves, for the names of several joints
_APART = 18.0  # of two names
_FRAMES_A_SECOND = 15
_LOOKS = {
    **LOOKS,
    "paper": Look("paper"),
    "words": Look("ink"),
    "axis": Look(None, "ink", 1),
    "is": Look(None, "blue", 2),
    "asked": Look(None, "orange", 2),
}


def moving_arm(shown: Shown, *, dashed: str = "asked for", narrow: bool = False) -> str:
    """Return an SVG that plays the record for ever, in light or dark as the screen is.

    Args:
        shown: what was recorded.
        dashed: what ``shown.wanted`` is.
        narrow: draw the arm above the curve, for the width of a phone.

    """
    at = _NARROW if narrow else _WIDE
    seconds = float(shown.time[-1] - shown.time[0])
    grid = np.linspace(0.0, seconds, max(round(seconds * _FRAMES_A_SECOND), 2))
    poses = shown.poses(grid)
    goals = None
    if shown.wanted is not None and np.isfinite(shown.wanted).all():
        goals = shown.at(grid, shown.spec.degrees(shown.wanted))
    arm = _arm(DrawnArm.of(shown.spec), poses, goals, seconds, at)
    looks = style(".pneumarm", _LOOKS)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="pneumarm" viewBox="0 0 {at.width} {at.height}" '
        f'width="{at.width}" height="{at.height}" font-family="sans-serif" font-size="14">{looks}'
        f'<rect class="paper" width="{at.width}" height="{at.height}"/>'
        f"{arm}{_curves(grid, poses.degrees, goals, at, dashed)}</svg>"
    )


def _arm(arm: DrawnArm, poses: Pose, goals: Array | None, seconds: float, at: _Layout) -> str:
    """Return the arm, and its goal behind it."""
    degrees = poses.degrees
    aside = np.abs(link_ends(degrees, arm.links)[..., 0]).max() + 30
    middle, top, bottom = at.arm
    scale = min((bottom - top) / (arm.above + arm.reach + 20), middle / aside)
    muscles = [
        "".join(
            _muscle(one, degrees[:, j], poses.full[:, j, m], poses.lights[:, j, m], seconds)
            for m, one in enumerate(pair)
        )
        for j, pair in enumerate(arm.muscles)
    ]
    chain = _chain(arm.turning, muscles, degrees, arm.links, seconds)
    ghost = "" if goals is None else _chain(arm.ghost, [""] * len(arm.links), goals, arm.links, seconds)
    return (
        f'<g transform="translate({middle} {top + scale * arm.above:.1f}) scale({scale:.3f})" stroke-linecap="round" '
        f'stroke-linejoin="round">{_paths(arm.plate)}{ghost}{chain}</g>'
    )


def _paths(shapes: list[Shape] | tuple[Shape, ...]) -> str:
    return "".join(f'<path class="{shape.kind}" d="{shape.path()}"/>' for shape in shapes)


def _chain(turning: list[list[Shape]], still: list[str], degrees: Array, links: list[float], seconds: float) -> str:
    """Return what turns about each joint, and over it what does not turn with it."""
    inner = ""
    for j in reversed(range(len(links))):
        turn = _animated("rotate", [f"{-value:.2f}" for value in degrees[:, j]], seconds)
        place = f' transform="translate(0 {links[j - 1]:.1f})"' if j else ""
        inner = f"<g{place}><g>{turn}{_paths(turning[j])}{inner}</g>{still[j]}</g>"
    return inner


def _muscle(muscle: Muscle, degrees: Array, full: Array, light: Array, seconds: float) -> str:
    wide, long = muscle.stretch(degrees, full)
    body = "".join(
        f'<path class="{shape.kind}" d="{shape.path()}">'
        + (_animated("fill-opacity", [f"{one:.2f}" for one in air(full)], seconds) if "air" in shape.kind else "")
        + "</path>"
        for shape in muscle.body
    )
    stretch = _animated("scale", [f"{x:.3f} {y:.3f}" for x, y in zip(wide, long, strict=True)], seconds)
    lit = "".join(
        f'<path class="{shape.kind}" d="{shape.path()}" fill-opacity="0">'
        + _animated("fill-opacity", [f"{max(sign * one, 0):.1f}" for one in light], seconds)
        + "</path>"
        for sign, shape in zip((1, -1), muscle.lights, strict=False)
        if (sign * light > 0).any()
    )
    x, y = muscle.at
    return f'<g transform="translate({x:.4g} {y:.4g})">{_paths(muscle.fixed)}<g>{stretch}{body}</g>{lit}</g>'


def _curves(grid: Array, degrees: Array, goals: Array | None, at: _Layout, dashed: str) -> str:
    """Return the angles over time with a cursor that moves along."""
    seconds, joints = float(grid[-1]), degrees.shape[1]
    both = degrees if goals is None else np.concatenate([degrees, goals])
    low, high = both.min() - 3, both.max() + 3
    right = at.right if joints == 1 else at.right - _NAMES
    x = at.left + (right - at.left) * grid / seconds

    def height(values: Array) -> Array:
        return at.bottom - (at.bottom - at.top) * (values - low) / (high - low)

    def line(values: Array, style: str) -> str:
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, height(values), strict=True))
        return f'<polyline points="{points}" {style}/>'

    curves = "" if goals is None else "".join(line(one, 'class="asked" stroke-dasharray="6 4"') for one in goals.T)
    curves += "".join(line(one, 'class="is"') for one in degrees.T)
    ticks = "".join(
        f'<text x="{at.left - 6}" y="{height(tick) + 4:.1f}" text-anchor="end">{tick:g}°</text>'.replace(">-", ">−")
        for tick in np.array(_ticks(low, high))
    )
    names = "".join(
        f'<text x="{right + 8}" y="{y + 4:.1f}">joint {joint + 1}</text>'
        for joint, y in enumerate(_spread(height(degrees[-1])) if joints > 1 else ())
    )
    places = [f"{one:.1f}" for one in x]
    cursor = _animated("x1", places, seconds) + _animated("x2", places, seconds)
    legend = "" if goals is None else f"dashed: {dashed}; solid: the arm"
    return (
        f'<g class="words"><path class="axis" d="M{at.left} {at.top}V{at.bottom}H{right}"/>{ticks}{curves}{names}'
        f'<line class="axis" y1="{at.top}" y2="{at.bottom}">{cursor}</line>'
        f'<text x="{right}" y="{at.bottom + 18}" text-anchor="end">{seconds:.0f} s</text>'
        f'<text x="{at.left}" y="{at.bottom + 36}">{legend}</text></g>'
    )


def _spread(heights: Array) -> Array:
    """Return the ``heights`` of names, moved down where one would be written over another."""
    order, spread = np.argsort(heights), heights.copy()
    for above, below in pairwise(order):
        spread[below] = max(spread[below], spread[above] + _APART)
    return spread


def _animated(name: str, values: list[str], seconds: float) -> str:
    turning = name in ("rotate", "scale")
    tag, attribute = ("animateTransform", "transform") if turning else ("animate", name)
    kind = f' type="{name}"' if turning else ""
    return (
        f'<{tag} attributeName="{attribute}"{kind} values="{";".join(values)}" dur="{seconds:.2f}s" '
        'repeatCount="indefinite"/>'
    )


def _ticks(low: float, high: float) -> list[float]:
    step = next(one for one in (5, 10, 20, 30, 60, 90) if (high - low) / one <= 8 or one == 90)
    return [float(tick) for tick in np.arange(np.ceil(low / step) * step, high, step)]
