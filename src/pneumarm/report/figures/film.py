"""A stretch of movement as one figure, and as the frames of a film: the arm, its angles, pressures and valves."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from numpy.typing import NDArray

from pneumarm.arm.hand import link_ends
from pneumarm.drawing.arm_picture import ArmPicture
from pneumarm.drawing.colours import DARK, INK, LIGHT, MIDDLE, PALE
from pneumarm.drawing.drawn_arm import DrawnArm
from pneumarm.drawing.moving_arm import Shown
from pneumarm.report.style import Described, key, legend_below, of_joint, styled
from pneumarm.task.changes import valve_changes

Array = NDArray[np.float64]

FRAMES_A_SECOND = 12.5
"""Frame rate of a film; 80 ms a frame, which a GIF can tell exactly."""
_DPI = 110
_SIZE = (7.4, 4.0)  # inch
_PAST = 8  # places where the arm was before, in a figure
_STYLES = ("-", (0, (5, 1.5)), (0, (3, 1, 1, 1)), (0, (1, 1)))  # of the joints' curves


def movement(shown: Shown, end: float | None = None, *, tolerance: float = 0.0) -> Described:
    """Draw a stretch of movement: the arm at its end and every now and then before, and what was read.

    Args:
        shown: the stretch (thesis figures 5.17 to 5.19).
        end: when the goal was reached [s] of ``shown.time``, or None.
        tolerance: around what was asked for, drawn as a band [counts].

    """
    figure, arm = _stage(shown)
    axes = figure.axes[1:]
    if shown.wanted is not None and tolerance:
        for wanted in shown.wanted.T:
            low, high = (shown.spec.degrees(wanted + one) for one in (-tolerance, tolerance))
            axes[0].fill_between(shown.time, low, high, color=LIGHT, alpha=0.5, linewidth=0)
    for place in axes:
        if end is not None:
            place.axvline(end, color=INK, linestyle=":", linewidth=1)
    figure.alt = _in_words(shown, end)
    poses = shown.poses(shown.time - shown.time[0])
    degrees = poses.degrees
    way = np.cumsum(np.abs(np.diff(degrees, axis=0, prepend=degrees[:1])).sum(axis=1))
    for share in np.linspace(0, 1, _PAST, endpoint=False):
        arm.add(DrawnArm.of(shown.spec).links_at(degrees[np.searchsorted(way, share * way[-1])], "past"), share + 0.2)
    goal = None if shown.wanted is None else shown.spec.degrees(shown.wanted[-1])
    arm.show(poses[-1], goal)
    return figure


def _in_words(shown: Shown, end: float | None) -> str:
    spec, joints, words = shown.spec, shown.spec.joints, []
    for j, seen in enumerate(spec.degrees(shown.angle).T):
        text = f"the angle{of_joint(j, joints)} goes from {seen[0]:.1f}° "
        if shown.wanted is None or not np.isfinite(shown.wanted[-1, j]):
            text += f"to {seen[-1]:.1f}°"
        else:
            goal = float(spec.degrees(shown.wanted[-1, j]))
            beyond = max(0.0, float(((seen - goal) * np.sign(goal - seen[0])).max()))
            text += f"to a goal of {goal:.1f}°, at most {beyond:.1f}° beyond it"
        if shown.pressure is not None:
            text += f"; the highest {spec.pressure_word} is {spec.bar(shown.pressure[:, j]).max():.2f} bar"
        words.append(text)
    reached = "" if end is None else f"; the goal is reached after {end:.2f} s"
    if shown.command is not None:
        moving = shown.command[shown.time < (np.inf if end is None else end)]
        reached += f", with {int(valve_changes(moving).sum())} valve changes"
    return f"On the way {'; '.join(words)}{reached}."


def frames(shown: Shown) -> Iterator[NDArray[np.uint8]]:
    """Yield the frames of a film, FRAMES_A_SECOND of them, each of shape (height, width, 3)."""
    figure, arm = _stage(shown, animated=True)
    place, *curves = figure.axes
    cursors = [(axes, axes.axvline(0.0, color=INK, linewidth=1.0, animated=True)) for axes in curves]
    canvas: Any = figure.canvas
    canvas.draw()
    background = canvas.copy_from_bbox(figure.bbox)
    times = np.arange(0.0, shown.time[-1], 1 / FRAMES_A_SECOND)
    goals = None if shown.wanted is None else shown.at(times, shown.spec.degrees(shown.wanted))
    poses = shown.poses(times)
    for k, time in enumerate(times):
        canvas.restore_region(background)
        for patch in arm.show(poses[k], None if goals is None else goals[k]):
            place.draw_artist(patch)
        for axes, cursor in cursors:
            cursor.set_xdata([time, time])
            axes.draw_artist(cursor)
        yield np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _stage(shown: Shown, **style: Any) -> tuple[Described, ArmPicture]:
    """Return the figure with all curves, and the arm in it."""
    figure, arm = _figure(shown), DrawnArm.of(shown.spec)
    figure.set_dpi(_DPI)
    ends = link_ends(shown.spec.degrees(shown.angle), arm.links)
    aside, below = max(float(np.abs(ends[..., 0]).max()), 100.0) + 25, arm.reach + 20
    return figure, ArmPicture(figure.axes[0], arm, aside, below, **style)


@styled
def _figure(shown: Shown) -> Described:
    """Return the figure with all curves; its first axes are for the arm."""
    figure = Described(figsize=_SIZE, layout="constrained")
    FigureCanvasAgg(figure)
    rows = [2.2] + [1.0] * (shown.pressure is not None) + [0.8] * (shown.command is not None)
    grid = figure.add_gridspec(len(rows), 2, width_ratios=(1, 1.75), height_ratios=rows)
    arm = figure.add_subplot(grid[:, 0])
    arm.axis("off")
    curves = [figure.add_subplot(grid[row, 1]) for row in range(len(rows))]
    _angles(curves[0], shown)
    if shown.pressure is not None:
        _pressures(curves[1], shown)
    if shown.command is not None:
        _valves(curves[-1], shown)
    for axes in curves:
        axes.set_xlim(0, max(shown.time[-1], shown.spec.period))
        axes.tick_params(labelbottom=axes is curves[-1])
    curves[-1].set_xlabel("time [s]")
    figure.align_ylabels(curves)
    legend_below(figure, handles := _keys(shown), [str(one.get_label()) for one in handles])
    return figure


def _keys(shown: Shown) -> list[Any]:
    """Return the entries of the legend."""
    joints = shown.spec.joints
    found = [key(DARK, _STYLES[j % len(_STYLES)], label=f"angle{of_joint(j, joints)}") for j in range(joints)]
    if shown.wanted is not None:
        found.append(key(MIDDLE, "--", label="asked for"))
    if shown.pressure is not None or shown.command is not None:
        found += [key(DARK, linewidth=0.9, label="muscle 1"), key(LIGHT, linewidth=0.9, label="muscle 2")]
    return found


def _angles(axes: Any, shown: Shown) -> None:
    joints = shown.spec.joints
    for j in range(joints):
        if shown.wanted is not None:
            axes.plot(shown.time, shown.spec.degrees(shown.wanted[:, j]), color=MIDDLE, linestyle="--", linewidth=1.2)
        axes.plot(shown.time, shown.spec.degrees(shown.angle[:, j]), color=DARK, linestyle=_STYLES[j % len(_STYLES)])
    axes.set_ylabel("angle [°]")


def _pressures(axes: Any, shown: Shown) -> None:
    assert shown.pressure is not None
    bar = shown.spec.bar(shown.pressure)
    for j in range(shown.spec.joints):
        for m, color in enumerate((DARK, LIGHT)):
            axes.plot(shown.time, bar[:, j, m], color=color, linestyle=_STYLES[j % len(_STYLES)], linewidth=1.1)
    axes.set_ylabel("pressure\n[bar]" if shown.spec.pressure_sensors else "estimated\n[bar]")


def _valves(axes: Any, shown: Shown) -> None:
    assert shown.command is not None
    places = [(j, m) for j in range(shown.spec.joints) for m in range(2)]
    for row, (j, m) in enumerate(reversed(places)):
        axes.axhline(row, color=PALE, linewidth=0.6)
        axes.step(shown.time, row + 0.4 * shown.command[:, j, m], where="post", color=(DARK, LIGHT)[m], linewidth=0.9)
    axes.set_yticks(range(len(places)), [_muscle(j, m, shown.spec.joints) for j, m in reversed(places)])
    axes.set_ylim(-0.6, len(places) - 0.4)
    axes.grid(axis="y", visible=False)
    axes.set_ylabel("valves")


def _muscle(joint: int, muscle: int, joints: int) -> str:
    return f"{joint + 1}.{muscle + 1}" if joints > 1 else f"{muscle + 1}"
