"""The page of an arm's check-up: what its muscles, its sensors and its joint do, and what is wrong."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from pneumarm.arm.spec_file import SoundState
from pneumarm.checkup.diagnose import WHITE, WORN, Complaint
from pneumarm.checkup.figures import (
    JOINT_HEADER,
    MUSCLE_HEADER,
    autocorrelation,
    detrended,
    irregularity,
    joint_figures,
    joint_row,
    muscle_row,
)
from pneumarm.checkup.measure import Checkup
from pneumarm.report.page import Picture, Section, Table, render
from pneumarm.report.style import DARK, GREY, LIGHT, MIDDLE, panels, styled

_LINES = ((DARK, "-"), (MIDDLE, "--"))


def checkup_page(checkup: Checkup, findings: Sequence[Complaint], sound: SoundState | None = None) -> str:
    """Return the page as HTML text; ``sound`` is what the arm did when it was calibrated."""
    name = checkup.spec.name
    verdict = [f"{len(findings)} thing(s) to see to." if findings else "Nothing is wrong with it."]
    rows = [(f.where, f.kind, f.told_by, f.remedy) for f in findings]
    said = [Table(("where", "what", "told by", "what to do"), rows, "What is wrong.", words=True)] if rows else []
    muscles = [
        (f"joint {j + 1}, muscle {m + 1}", *muscle_row(joint_figures(checkup, j), j, m, sound))
        for j in range(len(checkup.joints))
        for m in range(2)
    ]
    joints = [
        (f"joint {j + 1}", *joint_row(joint_figures(checkup, j), checkup.spec)) for j in range(len(checkup.joints))
    ]
    figures = [
        Table(("", *MUSCLE_HEADER), muscles, "Muscles and valves; times from the command on, to 63 % of the way."),
        Table(("", *JOINT_HEADER), joints, "Joints and their potentiometers."),
    ]
    return render(
        f"Check-up of {name}",
        verdict,
        [
            Section("Findings", [] if rows else ["None."], tables=said),
            Section("Figures", tables=figures),
            *[_of_joint(checkup, j) for j in range(len(checkup.joints))],
        ],
    )


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
                noise(checkup, j),
                "Noise at rest, detrended: power spectrum and autocorrelation (thesis A.1.3). White noise has a flat "
                "spectrum and no correlation; the grey band holds 99 % of what white noise shows; beyond the dotted "
                "lines it is said not to be white.",
                f"noise of {figures.angle_noise:.2f} counts in the angle",
            ),
            Picture(
                potentiometer(checkup, j),
                "The angle at rest against the difference of the pressures, up and down; and how irregular the angle "
                "is by place; over the dotted line it is worn there.",
                f"the upper half turns {figures.halves:.2f} times as far; irregular by {figures.worst:.1f} counts",
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
def noise(checkup: Checkup, j: int) -> Figure:
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
def potentiometer(checkup: Checkup, j: int) -> Figure:
    """Draw the angle against the pressure difference, and its irregularity by place."""
    figure, axes = panels(1, 2, 2.8)
    spec, test = checkup.spec, checkup.joints[j]
    difference = spec.bar(test.sweep.pressure[:, 0] - test.sweep.pressure[:, 1])
    turn = len(difference) // 2
    for piece, (color, line), name in ((slice(0, turn + 1), _LINES[0], "up"), (slice(turn, None), _LINES[1], "down")):
        angle = spec.degrees(test.sweep.angle[piece])
        axes[0, 0].plot(difference[piece], angle, line, color=color, marker="o", label=name)
    places, off = irregularity(test)
    axes[0, 1].bar(spec.degrees(places), off, width=0.8, color=DARK)
    axes[0, 1].axhline(WORN, color=GREY, linewidth=0.8, linestyle=":")
    axes[0, 0].set_xlabel("pressure 1 - pressure 2 [bar]")
    axes[0, 0].set_ylabel("angle at rest [°]")
    axes[0, 0].legend()
    axes[0, 1].set_xlabel("angle [°]")
    axes[0, 1].set_ylabel("irregularity, rms [counts]")
    return figure
