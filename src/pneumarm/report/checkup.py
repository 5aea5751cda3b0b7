"""The page of an arm's check-up: what its muscles, its sensors and its joint do, and what is wrong."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pneumarm.arm.seam import ArmSpec
from pneumarm.arm.spec_file import SoundState
from pneumarm.checkup.diagnose import WHITE, WORN, Complaint
from pneumarm.checkup.figures import (
    JOINT_HEADER,
    JOINT_WORDS,
    MUSCLE_HEADER,
    MUSCLE_WORDS,
    MuscleFigures,
    autocorrelation,
    detrended,
    ends,
    irregularity,
    joint_figures,
    joint_row,
    muscle_row,
)
from pneumarm.checkup.measure import Checkup, Trace
from pneumarm.drawing.colours import DARK, GREY, LIGHT, MIDDLE
from pneumarm.drawing.moving_arm import Shown
from pneumarm.report.page import Picture, Section, Table, render
from pneumarm.report.playing import playing
from pneumarm.report.style import panels, styled

_LINES = ((DARK, "-"), (MIDDLE, "--"))


def checkup_page(checkup: Checkup, findings: Sequence[Complaint], sound: SoundState | None = None) -> str:
    """Return the page as HTML text; ``sound`` is what the arm did when it was calibrated."""
    joints = range(len(checkup.joints))
    figures = [joint_figures(checkup, j) for j in joints]
    wrong = "Nothing is wrong with it." if not findings else _to_see_to(findings)
    told = [_in_a_sentence(checkup, j, figures[j].muscles) for j in joints]
    rows = [(f.where, f.kind, f.told_by, f.remedy) for f in findings]
    said = [Table(("where", "what", "told by", "what to do"), rows, "What is wrong.", words=True)] if rows else []
    of_muscles = [
        (f"joint {j + 1}, muscle {m + 1}", *muscle_row(figures[j], j, m, sound)) for j in joints for m in range(2)
    ]
    of_joints = [(f"joint {j + 1}", *joint_row(figures[j], checkup.spec)) for j in joints]
    tables = [
        Table(("", *MUSCLE_HEADER), of_muscles, f"Muscles and valves. {MUSCLE_WORDS}"),
        Table(("", *JOINT_HEADER), of_joints, f"Joints and their potentiometers. {JOINT_WORDS}"),
    ]
    return render(
        f"Check-up of {checkup.spec.name}",
        [" ".join([*told, wrong])],
        [
            Section("How it moves", figures=[_playing(checkup, j) for j in joints], opens=True),
            Section("Findings", [] if rows else ["None."], tables=said),
            Section("What was measured", tables=tables),
            *[_of_joint(checkup, j) for j in joints],
        ],
    )


def _name(checkup: Checkup, j: int) -> str:
    """Return what joint ``j`` is called in a sentence."""
    return f"joint {j + 1}" if len(checkup.joints) > 1 else "it"


def _to_see_to(findings: Sequence[Complaint]) -> str:
    """Say what is wrong, in a sentence."""
    found = "; ".join(f"{one.kind} ({one.where})" for one in findings)
    return f"{'One thing is' if len(findings) == 1 else f'{len(findings)} things are'} wrong: {found}."


def _in_a_sentence(checkup: Checkup, j: int, muscles: Sequence[MuscleFigures]) -> str:
    """Say how far joint ``j`` turns, and how fast its muscles fill and leak where they do."""
    low, high = (f"{angle:z.0f}°".replace("-", "−") for angle in checkup.spec.degrees(ends(checkup.joints[j])))
    slowest, leakiest = (max(getattr(one, what) for one in muscles) for what in ("fill_time", "leak"))
    does = [f"fill to two thirds within {slowest:.1f} s"] if np.isfinite(slowest) else []
    does += [f"leak up to {max(leakiest, 0.0):.1f} % a minute"] if np.isfinite(leakiest) else []
    of_muscles = f"; its muscles {' and '.join(does)}" if does else ""
    return f"{_name(checkup, j).capitalize()} turns from {low} to {high}{of_muscles}."


def _playing(checkup: Checkup, j: int) -> Picture:
    """Return joint ``j`` moving while each of its muscles was filled, held and exhausted."""
    one, two = (muscle.whole for muscle in checkup.joints[j].muscles)
    time = np.concatenate([one.time, two.time + one.time[-1] + checkup.settings.step])
    caption = "muscle 1 is filled, held and exhausted, and turns it one way; then muscle 2 turns it the other way."
    name = _name(checkup, j).replace("it", "the joint").capitalize()
    angle, pressure = (
        np.concatenate(both)[:, None] for both in ((one.angle, two.angle), (one.pressure, two.pressure))
    )
    alone = replace(checkup.spec, joints=1, links=checkup.spec.links[j : j + 1], sensors=())
    return playing(Shown(alone, time, angle, pressure=pressure), f"{name} moves: {caption}")


def _of_joint(checkup: Checkup, j: int) -> Section:
    figures = joint_figures(checkup, j)
    full = " and ".join(f"{m.full:.2f}" for m in figures.muscles)
    filled = " and ".join(f"{m.fill_time:.2f}" for m in figures.muscles)
    emptied = " and ".join(f"{m.exhaust_time:.2f}" for m in figures.muscles)
    times = f"full at {full} bar; 63 % of that after {filled} s; down to 37 % after {emptied} s"
    return Section(
        f"Joint {j + 1}",
        figures=[
            Picture(muscles(checkup, j), "Each muscle filled, held and exhausted alone, the other vented.", times),
            Picture(
                noise_figure(checkup, j),
                "Noise at rest, detrended: power spectrum and autocorrelation (thesis A.1.3). White noise has a flat "
                "spectrum and no correlation; the grey band holds 99 % of what white noise shows; beyond the dotted "
                "lines it does not count as white.",
                f"noise of {figures.angle_noise:.2f} counts in the angle",
            ),
            Picture(
                potentiometer_figure(checkup, j),
                "The angle at rest against the difference of the pressures, up and down; and how irregular the angle "
                "is by place; over the dotted line it is worn there.",
                f"the upper half turns {figures.halves:.2f} times as far; irregular by {figures.worst:.2f} degrees",
            ),
        ],
    )


@styled
def muscles(checkup: Checkup, j: int) -> Figure:
    """Draw pressures and angle while each muscle was filled, held and exhausted."""
    figure, axes = panels(2, 2, 4.2, sharex=True)
    spec, settings = checkup.spec, checkup.settings
    for m, test in enumerate(checkup.joints[j].muscles):
        trace = test.whole
        for other, (color, line) in enumerate(_LINES):
            label = f"muscle {other + 1}"
            axes[0, m].plot(trace.time, spec.bar(trace.pressure[:, other]), line, color=color, label=label)
        axes[1, m].plot(trace.time, spec.degrees(trace.angle), color=DARK)
        for ax in axes[:, m]:
            for end in (settings.fill, settings.fill + settings.hold):
                ax.axvline(end, color=GREY, linewidth=0.8, linestyle=":")
        axes[0, m].set_title(f"muscle {m + 1}: filled, held, exhausted")
        axes[1, m].set_xlabel("time [s]")
    axes[0, 0].set_ylabel("pressure [bar]")
    axes[1, 0].set_ylabel("angle [°]")
    axes[0, 0].legend()
    return figure


@styled
def noise_figure(checkup: Checkup, j: int) -> Figure:
    """Draw power spectrum and autocorrelation of the noise at rest."""
    figure, axes = panels(1, 2, 2.6)
    rest = checkup.joints[j].rest
    step = float(np.diff(rest.time).mean())
    styles = ((DARK, "-", "angle"), (MIDDLE, "--", "pressure 1"), (LIGHT, "-.", "pressure 2"))
    for values, (color, line, name) in zip((rest.angle, *rest.pressure.T), styles, strict=True):
        clean = detrended(rest.time, values)
        frequency, power = spectrum(clean, step)
        axes[0, 0].semilogy(frequency, np.maximum(power, 1e-12), line, color=color, label=name)
        axes[0, 1].plot(autocorrelation(clean), line, color=color, marker="o", markersize=2.5)
    band = 2.58 / np.sqrt(len(rest.time))
    axes[0, 1].axhspan(-band, band, color=GREY, alpha=0.3, linewidth=0)
    for side in (-WHITE, WHITE):
        axes[0, 1].axhline(side, color=GREY, linewidth=0.8, linestyle=":")
    axes[0, 0].set_xlabel("frequency [Hz]")
    axes[0, 0].set_ylabel("power density [counts²/Hz]")
    axes[0, 0].legend()
    axes[0, 1].set_xlabel("readings apart")
    axes[0, 1].set_ylabel("autocorrelation")
    return figure


def spectrum(values: np.ndarray, step: float, pieces: int = 16) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies [Hz] and the power density, the mean over pieces (Bartlett)."""
    length = len(values) // pieces
    cuts = values[: pieces * length].reshape(pieces, length)
    power = (np.abs(np.fft.rfft(cuts - cuts.mean(axis=1, keepdims=True))) ** 2).mean(axis=0) * 2 * step / length
    return np.fft.rfftfreq(length, step)[1:], power[1:]


@styled
def potentiometer_figure(checkup: Checkup, j: int) -> Figure:
    """Draw the angle against the pressure difference, and its irregularity by place."""
    figure, axes = panels(1, 2, 2.8)
    test = checkup.joints[j]
    draw_sweep(axes[0, 0], test.sweep, checkup.spec)
    places, off = irregularity(test, checkup.spec)
    axes[0, 1].bar(places, off, width=0.8, color=DARK)
    axes[0, 1].axhline(WORN, color=GREY, linewidth=0.8, linestyle=":")
    axes[0, 0].set_ylabel("angle at rest [°]")
    axes[0, 0].legend()
    axes[0, 1].set_xlabel("angle [°]")
    axes[0, 1].set_ylabel("irregularity, rms [°]")
    return figure


def draw_sweep(place: Axes, sweep: Trace, spec: ArmSpec) -> None:
    """Draw the angle at rest against the difference of the pressures, from one end to the other and back."""
    difference = spec.bar(sweep.pressure[:, 0] - sweep.pressure[:, 1])
    turn = len(difference) // 2
    for piece, (color, line), name in ((slice(0, turn + 1), _LINES[0], "up"), (slice(turn, None), _LINES[1], "down")):
        angle = spec.degrees(sweep.angle[piece])
        place.plot(difference[piece], angle, line, color=color, marker="o", label=name)
    place.set_xlabel("pressure 1 − pressure 2 [bar]")
