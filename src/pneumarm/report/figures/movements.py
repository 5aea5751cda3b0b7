"""One movement on the arm: angle, pressures and valves against time (thesis figures 5.17 to 5.19)."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.report.colours import DARK, INK, LIGHT, MIDDLE
from pneumarm.report.style import of_joint, panels, styled
from pneumarm.report.thesis import GOAL_TOLERANCE
from pneumarm.task.changes import valve_changes

Array = NDArray[np.float64]


@styled
def movement(
    time: Array, angle: Array, pressure: Array, valves: Array, goal: Array, end: float | None, spec: ArmSpec
) -> Figure:
    """Draw a movement, and what the arm does after its end if that was recorded too.

    Args:
        time: of the readings, shape (n,) [s].
        angle: shape (n, joints) [counts].
        pressure: shape (n, joints, 2) [counts].
        valves: in force from each reading to the next, shape (n, joints, 2): -1 out, 0 closed, +1 in.
        goal: shape (joints,) [counts].
        end: when the goal was reached [s], or None.
        spec: the arm, for units.

    """
    joints = angle.shape[1]
    figure, axes = panels(3, joints, 4.8, sharex=True, height_ratios=(4, 3, 2.2))
    t = time - time[0] if len(time) else time
    for joint in range(joints):
        above, middle, below = axes[:, joint]
        above.set_ylabel(f"angle{of_joint(joint, joints)} [°]")
        low, high = spec.degrees(goal[joint] + GOAL_TOLERANCE * np.array([-1, 1]))
        above.axhspan(
            low, high, color=LIGHT, alpha=0.5, lw=0, label=f"goal ± {GOAL_TOLERANCE / spec.counts_per_degree:.1f}°"
        )
        above.plot(t, spec.degrees(angle[:, joint]), color=DARK, marker=".", ms=4, label="angle")
        for muscle, (color, style) in enumerate(((DARK, "-"), (MIDDLE, "--"))):
            middle.plot(t, spec.bar(pressure[:, joint, muscle]), style, color=color, label=f"muscle {muscle + 1}")
        middle.set_ylabel(f"{spec.pressure_word} [bar]")
        middle.set_ylim(0)
        _valves(below, t, valves[:, joint])
        below.set_xlabel("time [s]")
        for place in (above, middle, below):
            if end is not None and len(time):
                place.axvline(end - time[0], color=INK, ls=":", lw=1)
        if end is not None and len(time):
            above.annotate("goal reached", (end - time[0], 1), xycoords=("data", "axes fraction"), xytext=(0, 2),
                           textcoords="offset points", ha="center", va="bottom", fontsize=8)  # fmt: skip
        above.legend(loc="best")
        middle.legend(loc="best")
    figure.align_ylabels(axes[:, 0])
    return figure


def _valves(place: Axes, t: Array, valves: Array) -> None:
    """Draw the valves (n, 2) as one lane a muscle: a bar up lets air in, a bar down lets air out."""
    for lane, name in ((1.0, "muscle 1"), (0.0, "muscle 2")):
        signal = valves[:, 0 if lane else 1]
        place.axhline(lane, color=INK, lw=0.6)
        for sign, color, hatch in ((1, DARK, ""), (-1, LIGHT, "////")):
            level = lane + 0.38 * np.where(sign * signal > 0, signal, 0)
            place.fill_between(t, lane, level, step="post", fc=color, hatch=hatch, ec=INK if hatch else color, lw=0.4)
        place.text(1.005, lane, name, transform=place.get_yaxis_transform(), va="center", fontsize=8)
    place.set_ylim(-0.5, 1.5)
    place.set_yticks([1.25, 0.75, 0.25, -0.25], ["in", "out", "in", "out"])
    place.set_ylabel("valves")
    place.grid(visible=False, axis="y")


def movement_alt(
    time: Array, angle: Array, pressure: Array, valves: Array, goal: Array, end: float | None, spec: ArmSpec
) -> str:
    """Say in words what :func:`movement` shows."""
    if len(time) == 0:
        return "Nothing was recorded of this movement."
    moving = time < (end if end is not None else np.inf)
    parts = []
    for joint in range(angle.shape[1]):
        seen = spec.degrees(angle[:, joint])
        overshoot = _overshoot(seen, float(spec.degrees(goal[joint])))
        peak = spec.bar(pressure[:, joint]).max()
        parts.append(
            f"the angle{of_joint(joint, angle.shape[1])} goes from {seen[0]:.1f}° to a goal of "
            f"{float(spec.degrees(goal[joint])):.1f}°, at most {overshoot:.1f}° beyond it; the highest "
            f"{spec.pressure_word} is {peak:.2f} bar"
        )
    reached = "the goal is not reached" if end is None else f"the goal is reached after {end - time[0]:.2f} s"
    changes = int(valve_changes(valves[moving]).sum())
    return f"On the way {'; '.join(parts)}; {reached}, with {changes} valve changes."


def _overshoot(angle: Array, goal: float) -> float:
    """Return how far the angle (n,) goes beyond the goal, seen from where it began."""
    beyond = (angle - goal) * np.sign(goal - angle[0])
    return max(0.0, float(beyond.max()))
