"""The drawn arm in a figure."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from numpy.typing import NDArray

from pneumarm.drawing.drawn_arm import COLOURS, LOOKS, DrawnArm, Pose, Shape

Array = NDArray[np.float64]

_CODES = {"M": [Path.MOVETO], "L": [Path.LINETO], "C": [Path.CURVE4] * 3, "Z": [Path.CLOSEPOLY]}


class ArmPicture:
    """An arm in axes, whose place in their figure must be final, as lines are as wide as the arm is large.

    Args:
        axes: which it fills; their unit becomes a millimetre.
        arm: what is drawn.
        aside: how far to the sides it reaches [mm].
        below: how far down [mm].
        **style: of all its patches.

    """

    def __init__(self, axes: Axes, arm: DrawnArm, aside: float, below: float, **style: Any) -> None:
        axes.set(xlim=(-aside, aside), ylim=(below, -arm.above), aspect="equal")
        axes.axis("off")
        axes.apply_aspect()
        (left, _), (right, _) = axes.transData.transform([(0, 0), (1, 0)])
        self._axes, self._arm, self._style = axes, arm, style
        self._points = (right - left) * 72 / axes.figure.dpi
        self._patches: list[PathPatch] = []

    def add(self, shapes: Iterable[Shape], opacity: float = 1.0) -> None:
        """Draw ``shapes`` for good."""
        for shape in shapes:
            self._set(self._patch(), shape, opacity)

    def show(self, pose: Pose, goal: Array | None = None) -> list[PathPatch]:
        """Draw the arm as in :meth:`DrawnArm.placed`, over its goal; return what is drawn, the lowest first."""
        goals = [] if goal is None or not np.isfinite(goal).all() else self._arm.links_at(goal)
        shapes = [*((shape, 1.0) for shape in goals), *self._arm.placed(pose)]
        while len(self._patches) < len(shapes):
            self._patches.append(self._patch())
        for patch, (shape, opacity) in zip(self._patches, shapes, strict=False):
            self._set(patch, shape, opacity)
        for patch in self._patches[len(shapes) :]:
            patch.set_visible(False)
        return self._patches[: len(shapes)]

    def _patch(self) -> PathPatch:
        patch = PathPatch(Path([(0, 0)]), capstyle="round", joinstyle="round", clip_on=False, **self._style)
        self._axes.add_patch(patch)
        return patch

    def _set(self, patch: PathPatch, shape: Shape, opacity: float) -> None:
        look, points = LOOKS[shape.kind], shape.points
        codes = [code for command in shape.commands for code in _CODES[command]]
        patch.set_path(Path(np.concatenate([points, points[: len(codes) - len(points)]]), codes))
        patch.set(
            facecolor=COLOURS[look.fill][0] if look.fill else "none",
            edgecolor=COLOURS[look.stroke][0] if look.stroke else "none",
            linewidth=look.width * self._points,
            alpha=look.opacity * opacity,
            visible=True,
        )
