"""Pictures of the same movements made by each controller, and of the error against frequency with its bound.

python -m benchmarks moving_pictures

Draws ``docs/moving.svg`` and ``docs/following.svg``. Controllers and rows are those of ``python -m benchmarks
moving``, and so are the settings from the environment; movements are made on the first of its arms, the bound is that
of the first three (:mod:`pneumarm.bound.moving`).
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from benchmarks.moving import AMPLITUDES, FREQUENCIES, Plan, arm_for, asked_for, key, prepared
from pneumarm.arm import open_arm
from pneumarm.arm.virtual import VirtualArm
from pneumarm.bound.moving import MovingBoundSettings, measure_moving_bound
from pneumarm.control.named import open_tracking
from pneumarm.drawing.colours import DARK, GREY, INK, LIGHT, MIDDLE
from pneumarm.learning import load_agent
from pneumarm.learning.servo import ServoAgent
from pneumarm.moving import MoveSettings, move, track
from pneumarm.report.style import styled
from pneumarm.task.reference import counts_of, parse_reference

DOCS = Path(__file__).parent.parent / "docs"
INKS = (DARK, MIDDLE, LIGHT, GREY)
STYLES = ("-", "--", "-.", ":")
GOALS = (-20.0, 20.0, 15.0)
HOLD = 1.5
SINE = "sine:1Hz,20deg"
BOUNDED = 3
WORDS = {
    "agent": "the default agent",
    "pid": "PID in cascade",
    "scheduled": "scheduled PID",
    "pwm": "PID, pulse width",
    "sliding": "sliding mode",
}
Course = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Times, angles and what was asked for."""


def measure() -> Iterator[str]:
    wished = asked_for()
    plan, arms, seeds = wished.plan, wished.arms, wished.seeds
    names = [name for name in wished.controllers if name != "plan"][: len(INKS)]
    yield str(save(movements({name: made(plan, name, arms[0]) for name in names}), "moving.svg"))
    rows = plan.rows()
    errors = {
        name: [np.mean([row["tracking"][key(AMPLITUDES[0], f, True)] for row in found]) for f in FREQUENCIES]
        for name in names
        if (
            found := [
                row
                for row in rows
                if (row["controller"], row["arm"] in arms, row["seed"] in seeds) == (name, True, True)
            ]
        )
    }
    bound = [bound_of(plan, arm) for arm in arms[:BOUNDED]]
    yield str(save(following(errors, [float(np.mean(one)) for one in zip(*bound, strict=True)]), "following.svg"))


def words_of(name: str) -> str:
    """Return what people call the controller ``name``."""
    kind, _, rate = name.partition("@")
    return WORDS[kind.removesuffix("-whole")] + (f", {rate} Hz" if rate else "")


def made(plan: Plan, name: str, arm: str) -> tuple[Course, Course]:
    """Return the movements to the goals one after the other, and along the sinusoid."""
    with open_arm(arm_for(name, arm), 1) as opened:
        mover, spec, _ = open_tracking(prepared(plan, name, arm, 0), opened, plan.tolerance)
        goals = counts_of(np.array(GOALS)[:, None], spec)
        moved = [*move(opened, mover, goals, MoveSettings(hold=HOLD, tries=1))][1:]
        begin = moved[0].recorded.time[0]
        times = np.concatenate([one.recorded.time - begin for one in moved])
        angles = np.concatenate([spec.degrees(one.recorded.angle[:, 0]) for one in moved])
        asked = np.concatenate([np.full(len(one.recorded.time), spec.degrees(one.goal[0])) for one in moved])
        tracked = track(opened, mover, parse_reference(SINE, spec), 4.0)
        passed = tracked.recorded.time - tracked.recorded.time[0]
        return (times, angles, asked), (
            passed,
            spec.degrees(tracked.recorded.angle[:, 0]),
            spec.degrees(tracked.wanted[:, 0]),
        )


def bound_of(plan: Plan, arm: str) -> list[float]:
    """Return the error [deg] at each frequency that the true physics of an arm allow."""
    agent = load_agent(Path(prepared(plan, "agent", arm, 0)))
    with open_arm(arm_for("agent", arm), 1) as opened:
        assert isinstance(opened, VirtualArm)
        assert isinstance(agent, ServoAgent)
        found = measure_moving_bound(opened, agent, MovingBoundSettings(goals=1, frequencies=FREQUENCIES))
    return [found["track"]["physics"][f"{frequency:g}"] for frequency in FREQUENCIES]


@styled
def movements(courses: dict[str, tuple[Course, Course]]) -> Figure:
    figure = Figure((7.4, 5.0), layout="constrained")
    for place, number, title in zip(figure.subplots(2, 1), (0, 1), ("two goals", "1 Hz, known ahead"), strict=True):
        for (name, course), color, style in zip(courses.items(), INKS, STYLES, strict=False):
            times, angles, asked = course[number]
            if color == INKS[0]:
                place.plot(times, asked, color=INK, lw=0.8, label="asked for")
            place.plot(times, angles, style, color=color, label=words_of(name))
        place.set_ylabel("angle [°]")
        place.set_title(title)
    figure.axes[0].legend(loc="best")
    figure.axes[1].set_xlabel("time [s]")
    return figure


@styled
def following(errors: dict[str, list[float]], bound: list[float]) -> Figure:
    figure = Figure((7.4, 3.4), layout="constrained")
    place = figure.subplots()
    for (name, found), color, style in zip(errors.items(), INKS, STYLES, strict=False):
        place.loglog(FREQUENCIES, found, style, marker="o", color=color, label=words_of(name))
    place.loglog(FREQUENCIES, bound, ":", marker="x", color=INK, label="possible with the true physics")
    place.set_xticks(FREQUENCIES, [f"{frequency:g}" for frequency in FREQUENCIES])
    place.set_yticks([0.1, 0.3, 1, 3], ["0.1", "0.3", "1", "3"])
    place.minorticks_off()
    place.set_xlabel(f"frequency of a sinusoid of {AMPLITUDES[0]:g}° [Hz]")
    place.set_ylabel("RMS error [°]")
    place.legend(loc="best")
    return figure


def save(figure: Figure, name: str) -> Path:
    figure.savefig(DOCS / name, metadata={"Date": None})
    return DOCS / name
