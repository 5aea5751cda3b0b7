"""Should the valves be closed while the sensors are read and the next action is chosen?

Factor: valves left as they are, or closed in that time (figure 2.8). Transitions are collected, a simulation is
fitted, an agent trained and moved on the arm each way. Besides, a muscle is inflated through some control periods
each way and watched every millisecond, which is figure 2.8 measured.

    pneumarm experiment valves-closed --out laboratory

Answer here: the simulation can extrapolate: its error is larger in counts with valves left as they are, but smaller
in parts of what the arm then moves, which accelerates a quarter more. That agents gain by it, in time, switches or
reward, five arms do not show.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pneumarm.arm import guarded
from pneumarm.control import BEGIN
from pneumarm.experiments.differences import above, below
from pneumarm.experiments.evidence import Column, change, difference, mean, numbers, samples, signed, table, thesis
from pneumarm.experiments.experiment import Analysis, Claim, Figures, LaboratorySettings, Report, Rows, run_seed
from pneumarm.experiments.pictures import Axis, against
from pneumarm.experiments.there_and_back import (
    TRAINING,
    Prepared,
    ThereAndBack,
    agent_columns,
    opened,
    prepared,
    trained_and_moved,
    usual,
)
from pneumarm.report.page import Picture, Section
from pneumarm.report.style import DARK, MIDDLE, panels, styled

_OPEN, _CLOSED = 1, 2
_PERIODS = 3
_EVERY = 0.001  # s
_REPEATS = 10
_WORSE = 5.0  # percent by which an error may be larger and still count as no worse


def inflation(
    arm: str, seed: int, pause: float, close: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Inflate the first muscle of ``arm`` from rest for some control periods, and watch it.

    Args:
        arm: its name.
        seed: of the begin state and the sensors' noise.
        pause: time at the end of each period in which the valves are closed if ``close`` [s].
        close: whether they are.

    Returns:
        Time [s], change of the angle of the first joint and of the pressure of the muscle [counts], each (n,).

    """
    with opened(arm, seed) as found:
        guard, period = guarded(found), found.spec.period
        BEGIN.reach(guard, np.random.default_rng(seed))
        closed = np.zeros((found.spec.joints, 2), np.int8)
        inlet = closed.copy()
        inlet[0, 0] = 1
        first = guard.read()
        time, angle, pressure = [0.0], [first.angle[0]], [first.pressure[0, 0]]
        for number in range(round(_PERIODS * period / _EVERY)):
            within = (number * _EVERY) % period
            guard.set_valves(closed if close and within >= period - pause else inlet)
            found.wait(_EVERY)
            reading = guard.read()
            time.append(reading.time - first.time)
            angle.append(reading.angle[0])
            pressure.append(reading.pressure[0, 0])
    return np.array(time), np.array(angle) - first.angle[0], np.array(pressure) - first.pressure[0, 0]


@dataclass(frozen=True)
class ValvesClosed(ThereAndBack):
    """The whole job with valves left open and closed while computing."""

    name: str = "valves-closed"
    title: str = "Valves left as they are, or closed, while computing"
    question: str = "What does it do to the simulation, and to the agent, to close the valves while computing?"
    source: str = "Thesis section 2.4.3, figure 2.8; section 3.3; appendix A"

    @property
    def trials(self) -> Mapping[int, str]:
        """The two ways."""
        return {_OPEN: "left as they are", _CLOSED: "closed while computing"}

    def prepare(self, arm: str, folder: Path, settings: LaboratorySettings, progress: Report) -> list[Prepared]:
        """Return a simulation of each way."""
        recipes = [usual(settings, close_while_computing=closed) for closed in (False, True)]
        return [prepared(arm, folder, recipe, settings, progress) for recipe in recipes]

    def measure(self, material: list[Prepared], trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Train an agent and move the arm with it; inflate a muscle and watch it."""
        chosen = material[trial - 1]
        goals = material[0].simulation.goal_range
        found = trained_and_moved(chosen, TRAINING, run, settings, goals)
        spec = chosen.simulation.spec
        seed = run_seed(settings, run) % 2**31
        pause = spec.latency or thesis(__name__)["pause"]
        made = [inflation(chosen.arm, seed + i, pause, trial == _CLOSED) for i in range(_REPEATS)]
        time, angle, pressure = np.mean(made, axis=0)
        watched = {
            f"after {1e3 * t:.0f} ms {name}": value
            for name, values in (("angle", angle), ("pressure", pressure))
            for t, value in zip(time, values, strict=True)
        }
        pauses = {"period": spec.period, "pause": pause}
        return {**chosen.figures, **found, **watched, **pauses}

    def analyse(self, rows: Rows) -> Analysis:
        """Return fit and performance each way."""
        printed = thesis(__name__)["step"]
        fit = [
            Column("std angle", "error of the angle [counts]", thesis={_OPEN: printed["angle"]}),
            Column("relative angle", "error of the angle, of its change [%]", 2, 100.0),
            Column("std velocity", "error of the velocity [counts/ms]", 3, thesis={_OPEN: printed["velocity"]}),
            Column("std pressure_1", "error of pressure 1 [counts]", thesis={_OPEN: printed["pressure_1"]}),
            Column("std pressure_2", "error of pressure 2 [counts]", thesis={_OPEN: printed["pressure_2"]}),
            Column("change velocity", "change of the velocity in a step [counts/ms]", 3),
        ]
        agent = agent_columns("seconds", "switches")
        trials, axis = self.trials, Axis("valves while computing", (0.0, 1.0), ("left", "closed"))

        def shown(columns: list[Column], caption: str) -> Picture:
            columns = [replace(column, thesis=None) for column in columns]  # another arm, out of scale
            return against(rows, trials, axis, columns, caption)

        times = sorted(
            int(name.split()[1])
            for name in rows.rows[0].figures
            if name.startswith("after ") and name.endswith("angle")
        )
        traces = {
            trial: {
                name: np.array([samples(rows, f"after {t} ms {name}", trial).mean() for t in times])
                for name in ("angle", "pressure")
            }
            for trial in trials
        }
        period, pause = (mean(rows, name, _OPEN).mean for name in ("period", "pause"))
        rises = [float(traces[trial]["angle"][-1]) for trial in (_OPEN, _CLOSED)]
        return Analysis(
            summary=[
                self.question,
                self._answer(rows),
                f"Closing takes {1e3 * pause:.0f} of the {1e3 * period:.0f} ms of a control period. Values are means "
                "over arms with 95 % intervals.",
            ],
            figures=numbers(rows, trials, [*fit, *agent]),
            sections=[
                Section(
                    "Figure 2.8 measured",
                    [
                        "The first muscle is inflated from rest for three control periods; the mean of all arms, "
                        "runs and repetitions. What changes within a pause is the memory of the air's flow (figure "
                        "A.2)."
                    ],
                    figures=[
                        Picture(
                            inflations(np.array(times), traces, period, pause),
                            "Valve, angle and pressure, the valve left open or closed while computing (figure 2.8).",
                            f"After {times[-1]} ms the angle has changed by {rises[0]:.1f} counts with the valve "
                            f"left open and by {rises[1]:.1f} counts with pauses.",
                        )
                    ],
                ),
                Section(
                    "The simulation",
                    tables=[
                        table(
                            rows,
                            trials,
                            fit,
                            "Errors of a step on sequences that were not fitted; beside them table 5.2, the thesis' "
                            "arm at 30 Hz with its valves left as they are.",
                        )
                    ],
                    figures=[shown(fit, "Errors of a step each way.")],
                ),
                Section(
                    "The agent on the arm",
                    tables=[table(rows, trials, agent, "What agents make of it.")],
                    figures=[shown(agent, "What agents make of it.")],
                ),
            ],
            claims=self.claims(rows),
        )

    def _answer(self, rows: Rows) -> str:
        counts, share, thrust = (
            signed(change(rows, name, _OPEN, _CLOSED), 1)
            for name in ("std angle", "relative angle", "change velocity")
        )
        reward = signed(difference(rows, "reward", _OPEN, _CLOSED), 1)
        return (
            f"Against closed ones, valves left as they are change the error of the angle by {counts} % in counts and "
            f"by {share} % in parts of what the arm moves in a step, its acceleration by {thrust} %, and what agents "
            f"earn on the arm by {reward}."
        )

    def claims(self, rows: Rows) -> list[Claim]:
        """Return what the thesis says, and what the rows say to it."""
        error = change(rows, "relative angle", _OPEN, _CLOSED)
        counts = change(rows, "std angle", _OPEN, _CLOSED)
        thrust = change(rows, "change velocity", _OPEN, _CLOSED)
        time = difference(rows, "seconds", _OPEN, _CLOSED)
        switches = difference(rows, "switches", _OPEN, _CLOSED)
        reward = difference(rows, "reward", _OPEN, _CLOSED)
        return [
            Claim(
                "The simulation can extrapolate: with valves left as they are its error, in parts of the change, is "
                f"no more than {_WORSE:g} % larger",
                "from residues and isoplots (section 3.3, appendix A); no number",
                f"left against closed: {signed(error)} % (in counts {signed(counts)} %)",
                below(error, _WORSE),
                "closed-valves",
            ),
            Claim(
                "Valves left as they are let the arm accelerate more",
                "a reason for it (section 2.4.3); no number",
                f"root mean square of the change of the velocity in a step, left against closed: {signed(thrust)} %",
                above(thrust),
                "closed-valves",
            ),
            Claim(
                "Valves left as they are make control faster",
                "a reason for it (section 2.4.3); no number",
                f"time of a movement, left less closed: {signed(time, 3)} s",
                below(time),
                "closed-valves",
            ),
            Claim(
                "Valves left as they are make control smoother: fewer switches",
                "a reason for it (section 2.4.3); no number",
                f"switches of a movement, left less closed: {signed(switches)}",
                below(switches),
                "closed-valves",
            ),
            Claim(
                "Valves left as they are give at least as much reward on the arm",
                "chosen (section 2.4.3); no number",
                f"left less closed: {signed(reward)}",
                above(reward, -1.0),
                "closed-valves",
            ),
        ]


@styled
def inflations(
    times: NDArray[np.int64], traces: Mapping[int, Mapping[str, NDArray[np.float64]]], period: float, pause: float
) -> Figure:
    """Draw figure 2.8: the valve, the angle and the pressure of the muscle in time [ms]."""
    figure, axes = panels(3, 1, 4.6, sharex=True, height_ratios=(1, 2, 2))
    valve, angle, pressure = axes[:, 0]
    fine = np.arange(0, times[-1] + 0.1, 0.1)
    shut = (fine / 1e3) % period >= period - pause
    for trial, colour, style, words in (
        (_OPEN, DARK, "-", "left open"),
        (_CLOSED, MIDDLE, "--", "closed in the pause"),
    ):
        valve.plot(fine, np.where(shut & (trial == _CLOSED), 0, 1), color=colour, ls=style)
        angle.plot(times, traces[trial]["angle"], color=colour, ls=style, label=words)
        pressure.plot(times, traces[trial]["pressure"], color=colour, ls=style)
    valve.set_yticks([0, 1], ["closed", "inlet open"])
    angle.set_ylabel("change of the\nangle [counts]")
    pressure.set_ylabel("change of the\npressure [counts]")
    pressure.set_xlabel("time [ms]")
    angle.legend(loc="upper left")
    for begin in fine[1:][shut[1:] & ~shut[:-1]]:
        for axis in (valve, angle, pressure):
            axis.axvspan(begin, begin + 1e3 * pause, color="#eeeeee", zorder=0)
    return figure


EXPERIMENT = ValvesClosed()
"""``pneumarm experiment``."""
