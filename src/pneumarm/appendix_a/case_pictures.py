"""The pictures that reveal the errors of appendix A: the same for all cases, side by side, on the same scales."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pneumarm.appendix_a.runs import Case
from pneumarm.checkup import Checkup
from pneumarm.checkup.figures import LAGS, detrended
from pneumarm.drawing.colours import DARK, GREY, INK, MIDDLE, PALE
from pneumarm.report.checkup import draw_sweep, spectrum
from pneumarm.report.style import key, legend_below, panels, quantities, scatter, styled
from pneumarm.statistics import binned

Array = NDArray[np.float64]

_JOINT = 0  # the errors are played on joint 1
_AROUND = 0.06  # s before and after a pulse that is shown
_IN_A_ROW = 150  # transitions


@styled
def opening(cases: Sequence[Case]) -> Figure:
    """Draw the first pressure while a pulse of air is let in, and after it (thesis figures A.1 and A.2)."""
    figure, axes = panels(1, len(cases), 2.6, sharey=True)
    for place, case in zip(axes[0], cases, strict=True):
        checkup = _checked(case)
        tested = checkup.joints[_JOINT].muscles[0]
        trace, pulse = tested.pulse, tested.pulsed
        shown = trace.time < pulse + _AROUND
        place.axvspan(0, 1e3 * pulse, color=PALE, lw=0)
        place.plot(1e3 * trace.time[shown], case.spec.bar(trace.pressure[shown, 0]), color=DARK, lw=1)
        place.set_xlabel("time since the inlet was opened [ms]")
        place.set_title(case.name)
    axes[0, 0].set_ylabel("pressure 1 [bar]")
    return figure


@styled
def isoplots(cases: Sequence[Case], which: Sequence[int]) -> Figure:
    """Draw simulated against observed change (thesis figure 3.3) of the quantities ``which``, a row each."""
    figure, axes = panels(len(which), len(cases), 2.9 * len(which), sharex="row", sharey="row")
    for row, i in zip(axes, which, strict=True):
        kind = quantities(cases[0].spec)[i]
        both = [
            kind.per_count * np.stack([case.observed[:, _JOINT, i], case.simulated[:, _JOINT, i]]) for case in cases
        ]
        limit = max(float(np.percentile(np.abs(one), 99.8)) for one in both)
        for place, case, (x, y) in zip(row, cases, both, strict=True):
            scatter(place, x, y, s=3, alpha=0.3)
            place.plot([-limit, limit], [-limit, limit], color=INK, ls="--", lw=1)
            place.set(xlim=(-limit, limit), ylim=(-limit, limit), xlabel=f"observed change [{kind.unit}]")
            place.set_title(f"{case.name}\n{kind.name}, std {(y - x).std():.2g} {kind.unit}")
        row[0].set_ylabel(f"simulated change [{kind.unit}]")
    return figure


@styled
def sweeps(cases: Sequence[Case]) -> Figure:
    """Draw the angle at rest against the difference of the pressures, from one end to the other and back."""
    figure, axes = panels(1, len(cases), 2.8, sharey=True)
    for place, case in zip(axes[0], cases, strict=True):
        draw_sweep(place, _checked(case).joints[_JOINT].sweep, case.spec)
        place.set_title(case.name)
    axes[0, 0].set_ylabel("angle as read [°]")
    legend_below(figure, *axes[0, 0].get_legend_handles_labels())
    return figure


def _residue(case: Case) -> Array:
    """Return the residue of the angle, shape (n,) [degrees]."""
    residue: Array = case.residue[:, _JOINT, 0] / case.spec.counts_per_degree
    return residue


@styled
def by_angle(cases: Sequence[Case]) -> Figure:
    """Draw the residue of the angle by the angle it was made at (thesis figure 3.2)."""
    figure, axes = panels(1, len(cases), 2.8, sharey=True)
    limit = max(float(np.percentile(np.abs(_residue(case)), 99.8)) for case in cases)
    for place, case in zip(axes[0], cases, strict=True):
        angle, residue = case.spec.degrees(case.angle[:, _JOINT]), _residue(case)
        scatter(place, angle, residue, s=3, alpha=0.25)
        stats = binned(angle, residue, bins=20)
        place.errorbar(
            stats.centre, stats.mean, stats.std, fmt="s-", color=MIDDLE, ms=3.5, capsize=2, lw=1.2, mec=INK, mew=0.5
        )
        place.set(ylim=(-limit, limit), xlabel="angle as read [°]")
        place.set_title(f"{case.name}: std {residue.std():.2g}°")
    axes[0, 0].set_ylabel("residue of the angle [°]")
    return figure


@styled
def noise(cases: Sequence[Case]) -> Figure:
    """Draw power spectrum and autocovariance of the first pressure at rest (thesis A.1.3)."""
    figure, axes = panels(1, 2, 2.9)
    looks = list(zip(("-", "--", "-."), (GREY, MIDDLE, DARK), strict=True))
    for case, (line, color) in zip(cases, looks, strict=False):
        rest = _checked(case).joints[_JOINT].rest
        clean = detrended(rest.time, rest.pressure[:, 0])
        frequency, power = spectrum(clean, float(np.diff(rest.time).mean()))
        axes[0, 0].semilogy(frequency, np.maximum(power, 1e-12), line, color=color)
        axes[0, 1].plot(covariance(clean), line, color=color, marker="o", ms=3)
    axes[0, 0].set(xlabel="frequency [Hz]", ylabel="power density [counts²/Hz]")
    axes[0, 1].set(xlabel="readings apart", ylabel="autocovariance [counts²]")
    names = [f"{case.name}: std {_spread(case):.2g} counts" for case in cases]
    legend_below(figure, [key(color, line) for line, color in looks[: len(cases)]], names)
    return figure


def _spread(case: Case) -> float:
    rest = _checked(case).joints[_JOINT].rest
    return float(detrended(rest.time, rest.pressure[:, 0]).std())


def covariance(values: Array) -> Array:
    """Return the autocovariance at lags 0..LAGS: the inverse Fourier transform of the power spectrum (A.1.3)."""
    power = np.abs(np.fft.rfft(values - values.mean(), 2 * len(values))) ** 2
    result: Array = np.fft.irfft(power)[: LAGS + 1] / len(values)
    return result


@styled
def in_a_row(cases: Sequence[Case]) -> Figure:
    """Draw the residue of the angle, transition after transition (thesis figure 3.1)."""
    figure, axes = panels(len(cases), 1, 1.5 * len(cases) + 0.3, sharex=True, sharey=True)
    for place, case in zip(axes[:, 0], cases, strict=True):
        residue = _residue(case)
        shown = residue[:_IN_A_ROW]
        place.vlines(np.arange(len(shown)), 0, shown, color=DARK, lw=1)
        place.axhline(0, color=INK, lw=0.7)
        place.set_ylabel("residue [°]")
        place.set_title(f"{case.name}: std {residue.std():.2g}°")
    axes[-1, 0].set_xlabel("transition k [-]")
    return figure


def _checked(case: Case) -> Checkup:
    if case.checkup is None:
        raise ValueError(f"no check-up was made of the case {case.name!r}")
    return case.checkup
