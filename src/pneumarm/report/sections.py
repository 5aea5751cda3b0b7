"""The sections of a run's report: which figures, with which words."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.adaptation import WatchSettings
from pneumarm.arm.seam import ArmSpec
from pneumarm.arm.valves import to_actions
from pneumarm.control.versions import Adapted
from pneumarm.drawing.moving_arm import Shown
from pneumarm.report.data import (
    CoverageData,
    Demonstration,
    MarkedData,
    MovingData,
    QualityData,
    TrainingData,
    TransferData,
)
from pneumarm.report.figures.adaptation import CurveMark, adaptation_curves
from pneumarm.report.figures.coverage import cells, new_share, projections
from pneumarm.report.figures.film import movement
from pneumarm.report.figures.importance import input_importance
from pneumarm.report.figures.isoplots import isoplot
from pneumarm.report.figures.propagation import error_propagation
from pneumarm.report.figures.residues import IN_A_ROW, Classification, residue_by_class, residues
from pneumarm.report.figures.training import PRICE, training_curves
from pneumarm.report.figures.transfer import Phase, transfer_curves
from pneumarm.report.health import health, tells_of_health
from pneumarm.report.ledger import beside_thesis, bound_table, ledger, written
from pneumarm.report.page import Picture, Section, Table
from pneumarm.report.playing import playing
from pneumarm.report.style import of_joint, quantities
from pneumarm.report.thesis import GOAL_TOLERANCE
from pneumarm.task import Movements, running_time
from pneumarm.transitions.filtering import NEW_CELLS

COVERAGE, ONE_STEP = "Coverage of the collected data", "How well the simulation predicts one step"
"""Titles of sections that others lead to."""


@dataclass(frozen=True)
class RunData:
    """Everything that the report of a run is made of; what is None has not been done and is left out."""

    spec: ArmSpec
    results: Mapping[str, Any]
    """Contents of ``results.json``."""
    coverage: CoverageData | None = None
    quality: QualityData | None = None
    training: TrainingData | None = None
    test: Movements | None = None
    transfer: TransferData | None = None
    adaptation: Adapted | None = None
    demonstrations: tuple[Demonstration, ...] = ()
    marked: MarkedData | None = None
    moving: MovingData | None = None


def learning_sections(run: RunData) -> list[Section]:
    """Return the sections of ``run`` on what is done before an agent moves the arm."""
    sections = []
    if run.coverage is not None:
        sections.append(coverage_section(run.coverage, run.spec))
    if run.quality is not None:
        sections += [
            simulation_section(run.quality, run.spec),
            propagated(run.quality, run.spec, run.results.get("simulation", {})),
        ]
    if run.training is not None:
        sections.append(trained(run.training, run.spec))
    return sections


def moved(run: RunData) -> list[Section]:
    """Return the sections of ``run`` on how an agent learned from moving the arm."""
    return [] if run.adaptation is None else [adapted(run.adaptation, run.spec)]


def reached(run: RunData) -> list[Section]:
    """Return the figures of the thesis' task; averages only where there are enough movements."""
    sections = [demonstrated(run.demonstrations, run.spec)] if run.demonstrations else []
    if run.transfer is not None and max(phase.n for phase in run.transfer.phases.values()) >= _FEWEST_AVERAGED:
        sections.append(transferred(run.transfer, run.test))
    return sections


PARTS: Mapping[str, Callable[[RunData], list[Section]]] = {
    "learned": learning_sections,
    "moved": moved,
    "reached": reached,
}
"""What can be drawn before a run ends, each by its name, in the order in which it can."""
_FEWEST_AVERAGED = 100  # movements; the bands of fewer cover everything


def all_sections(run: RunData, drawn: Mapping[str, Sequence[Section]] | None = None) -> list[Section]:
    """Return the sections of ``run``: the arm, folded how it came to that, and at the end the thesis' task.

    ``drawn`` are parts that are there.
    """
    parts = {name: (drawn or {}).get(name) or part(run) for name, part in PARTS.items()}
    shown, results = run.moving or one_after_the_other(run.demonstrations), run.results
    detailed = [*followed(results, run.spec), *parts["learned"], *parts["moved"]]
    if tells_of_health(results):
        detailed.insert(0, health(results, run.marked, run.spec))
    task = [overview(run), *parts["reached"]]
    return [
        *([] if shown is None else [moving(shown, run.spec)]),
        *(replace(section, folded=True) for section in detailed),
        Section("The thesis' task", [task_words(results)]),
        *(replace(section, folded=True) for section in task),
    ]


def one_after_the_other(shown: Sequence[Demonstration]) -> MovingData | None:
    """Return demonstrations as one record, without what passed between them; None where there are none."""
    if not shown:
        return None
    times, begin = [], 0.0
    for one in shown:
        times.append(one.time - one.time[0] + begin)
        begin = times[-1][-1] + float(np.diff(one.time).mean())
    return MovingData(
        time=np.concatenate(times),
        angle=np.concatenate([one.angle for one in shown]),
        wanted=np.concatenate([np.tile(one.goal, (len(one.time), 1)) for one in shown]),
        pressure=np.concatenate([one.pressure for one in shown]),
    )


def moving(data: MovingData, spec: ArmSpec) -> Section:
    """Return how the arm moves, as a picture that plays."""
    caption = "The arm as it moved to its goals, which are orange. The more pressure in a muscle, the thicker it is."
    return Section("How it moves", (), [playing(data.shown(spec), caption)], opens=True)


def followed(results: Mapping[str, Any], spec: ArmSpec) -> list[Section]:
    """Return the sinusoids that were followed; no section where there were none."""
    tracked = [
        (f"{one['frequency_hz']:g} Hz, {one['amplitude_deg']:.0f}°", *(f"{e:.2f}" for e in one["rms_error_deg"]))
        for one in results.get("track", [])
    ]
    errors = (f"RMS error{of_joint(joint, spec.joints)} [°]" for joint in range(spec.joints))
    table = Table(("sinusoid", *errors), tracked, "Sinusoids that were followed, the reference known ahead.")
    return [Section("How it follows a reference", tables=[table])] if tracked else []


def reached_words(run: RunData) -> list[str]:
    """Return how an agent reaches goals, in the thesis' measure, as sentences."""
    text = []
    if run.test is not None and run.test.n:
        text.append(
            f"In the simulation the controller reaches {run.test.success.mean():.1%} of its goals with a mean reward "
            f"of {written(run.test.reward.mean(), '{:.2f}')}."
        )
    if run.transfer is not None:
        parts = [
            f"{phase.success.mean():.1%} {words} (mean reward {written(phase.reward.mean(), '{:.2f}')})"
            for words, phase in (("on arrival", run.transfer.before), ("after adaptation", run.transfer.after))
            if phase.n
        ]
        if parts:
            text.append("On the arm it reaches " + " and ".join(parts) + ".")
    bound = run.results.get("bound", {})
    if "after" in bound.get("distance", {}):
        best = max(bound["distance"]["after"], key=lambda plans: float(bound["distance"]["after"][plans]["planned"]))
        distance = bound["distance"]["after"][best]
        earned = distance["planned"] - distance["reward"]
        text.append(
            f"In the first {distance['episodes']} movements after adaptation the controller earns "
            f"{written(earned, '{:.2f}')}, planning with the arm's true physics "
            f"{written(distance['planned'], '{:.2f}')}."
        )
    return text


def task_words(results: Mapping[str, Any]) -> str:
    """Say what the thesis' task is."""
    words = "In the thesis a goal is reached once it is touched slowly enough, and changing valves costs reward."
    if results.get("settle"):
        words += " This agent was not trained for that: it stays at goals, and does not save changes."
    return words


def overview(run: RunData) -> Section:
    """Return the ledger and the comparison with the thesis."""
    bound, words = run.results.get("bound", {}), reached_words(run)
    text = [" ".join(words)] if words else []
    if "missing" in bound and not run.results.get("settle"):
        text.append(f"What can be achieved on this arm at all is unknown: {bound['missing']}.")
    return Section(
        "Reward, and the thesis' figures beside ours",
        text,
        tables=(
            ledger(run.test, run.transfer, run.results.get("test", {}).get("lookahead")),
            *([bound_table(bound)] if "distance" in bound else []),
            beside_thesis(run.results, run.quality, run.test, run.transfer, run.spec),
        ),
    )


def _ranges(data: CoverageData, spec: ArmSpec) -> str:
    """Say over which angles goals lie, those that are not rare."""
    angles = spec.degrees(np.percentile(data.observation[:, :, 0], (1, 99), axis=0)).T
    ends = [[written(end, "{:.0f}°") for end in joint] for joint in angles]
    found = (f"from {low} to {high}{of_joint(i, len(ends))}" for i, (low, high) in enumerate(ends))
    return f"All but 2% of the angles lie {', '.join(found)}; goals beyond them are refused."


def coverage_section(data: CoverageData, spec: ArmSpec) -> Section:
    """Return what the collected data covers."""
    occupied = int(data.cells_holding[1:].sum())
    text = [
        f"The filter divides observations and actions into {data.cells:,} cells and keeps at most {data.per_cell} "
        f"transitions of each, so that the simulation is fitted to all states alike (thesis section 3.2.3). "
        f"{occupied:,} cells are occupied. The others were not reached: most angles go with few pressures, "
        "and a recording does not say which of the others this arm can be in. " + _ranges(data, spec)
    ]
    if len(data.growth) > 1:
        share = new_share(data.growth)
        text.append(f"The second half of the data added {share:.1%} of the occupied cells. {NEW_CELLS}")
    return Section(
        COVERAGE,
        text,
        (
            Picture(
                projections(data.observation, spec),
                "Where the observations lie (99.9% of each quantity); where it is blank there were none "
                "(thesis section 3.2.2; no figure there).",
            ),
            Picture(
                cells(data.cells_holding, data.per_cell, data.growth),
                "Transitions in the cells of the filter's grid and, where it was followed, the number of cells "
                "occupied while collecting (thesis section 3.2.3; no figure there).",
            ),
        ),
    )


def classifications(data: QualityData, joint: int, spec: ArmSpec) -> list[Classification]:
    """Return the classes that residues are looked at by: velocity, angle, action (or command) and time."""
    angle, velocity = quantities(spec)[:2]
    command = data.command[:, joint]
    if np.isin(command, (-1, 0, 1)).all():
        acted = Classification("action (valves of muscle 1, 2)", to_actions(command).astype(float), actions=True)
    else:
        acted = Classification("command of muscle 1 [-]", command[:, 0])
    return [
        Classification(velocity.in_units(), velocity.per_count * data.observation[:, joint, 1]),
        Classification(angle.in_units(), spec.degrees(data.observation[:, joint, 0])),
        acted,
        _times(data.time),
    ]


def _times(time: NDArray[np.float64]) -> Classification:
    if len(time) and time.max() < 120:
        return Classification("time since the begin [s]", time)
    return Classification("time since the begin [min]", time / 60)


def predicted_words(data: QualityData, spec: ArmSpec) -> list[str]:
    """Return how exactly the simulation predicts the angle, soon and later, as sentences."""
    moved, off = (
        float(np.sqrt(np.mean(change[:, :, 0] ** 2))) / spec.counts_per_degree
        for change in (data.target - data.observation, data.predicted - data.target)
    )
    text = (
        f"In {1e3 * spec.period:.0f} ms the arm turns by {moved:.2f}°, root mean square, and the simulation is off "
        f"by {off:.2f}°, {off / moved if moved else 0:.0%} of that"
    )
    if len(data.propagation):
        later = np.sqrt(np.mean(data.propagation[-1, :, 0] ** 2)) / spec.counts_per_degree
        seconds = len(data.propagation) * spec.period
        text += f"; going on from its own predictions it is off by {later:.1f}° after {seconds:.2g} s"
    return [f"{text}. All of this is on recordings that it was not fitted to."]


def one_step(data: QualityData, spec: ArmSpec) -> Section:
    """Return the recorded arm beside what was predicted of it a step before, as a picture that plays."""
    shown = slice(IN_A_ROW)
    observed, simulated = (one[shown, :, 0].astype(np.float64) for one in (data.target, data.predicted))
    time = spec.period * np.arange(len(observed), dtype=np.float64)
    caption = "The recorded arm, and in orange where the simulation expected it one reading before."
    return Section(
        "How it moved", (), [playing(Shown(spec, time, observed, simulated), caption, dashed="predicted")], opens=True
    )


def simulation_section(data: QualityData, spec: ArmSpec) -> Section:
    """Return residues and isoplots."""
    joints = data.observation.shape[1]
    error = (data.predicted - data.target)[:, :, 0] / spec.counts_per_degree
    real, simulated = data.target - data.observation, data.predicted - data.observation
    pictures = [
        Picture(
            residues(data.target[:, :, 0], data.predicted[:, :, 0], spec),
            "Observed and simulated angle of successive transitions and the residue between them "
            "(thesis figure 3.1).",
        )
    ]
    for joint in range(joints):
        classes = classifications(data, joint, spec)
        pictures.append(
            Picture(
                residue_by_class(error[:, joint], classes),
                f"Residue of the angle{of_joint(joint, joints)} against classes of the transitions "
                "(thesis figure 3.2): "
                "points are transitions, squares and bars are mean and standard deviation in a class. A trend of the "
                "means is a bias, a trend of the bars shows where the simulation is unsure. Valves: + in, 0 closed, "
                "−\u00a0out.",
            )
        )
    pictures.append(
        Picture(
            isoplot(real, simulated, spec),
            "Simulated against observed change, coloured by the number of transitions. The closer to the 45° line "
            "and the narrower, the better; a slope other than 1 is a structural error (thesis figures 3.3 to 3.5).",
        )
    )
    return Section(
        ONE_STEP,
        (
            f"The simulation's prediction one step ahead, on {len(error):,} transitions of sequences that it was not "
            "fitted to (thesis section 3.3).",
        ),
        pictures,
    )


def propagated(data: QualityData, spec: ArmSpec, figures_found: Mapping[str, Any]) -> Section:
    """Return the error over many steps and, where there is one, the importance of the inputs.

    ``figures_found`` are those of an analysis: what it says of invalid predictions is told (thesis section 3.4).
    """
    pictures = [
        Picture(
            error_propagation(data.propagation, spec),
            "Standard deviation of the error when the simulation runs freely, beside the growth with the square root "
            "of the steps that uncorrelated errors would give (thesis eq. 3.7; no figure there).",
        )
    ]
    if data.weights.size:
        pictures.append(
            Picture(
                input_importance(data.weights, data.inputs, data.outputs),
                "Weights of a least-squares fit as the importance of its inputs: the change of an output, in its "
                "standard deviations, for one standard deviation of the input (thesis section 3.2.4; "
                "no figure there).",
            )
        )
    return Section(
        "How errors grow over many steps",
        (
            "Small errors add up over a movement. Above the dashed line errors of successive steps are alike and add "
            "up faster than chance; below it the arm's own dynamics pull the simulation back.",
            *_invalid(figures_found, spec),
        ),
        pictures,
    )


def _invalid(found: Mapping[str, Any], spec: ArmSpec) -> list[str]:
    if "invalid" not in found or "propagation" not in found:
        return []
    invalid, spread = found["invalid"], found["propagation"]
    before, remedied = (
        np.atleast_1d(spread[name]["angle"]) / spec.counts_per_degree for name in ("measured", "resynchronised")
    )
    errors = " and ".join(f"from {a:.2f}° to {b:.2f}°" for a, b in zip(before, remedied, strict=True))
    return [
        f"After {spread['steps']} simulated steps {invalid['simulated']:.1%} of the states lie in cells of the "
        f"filter's grid that hold no data, and {invalid['recorded']:.1%} of the recorded ones do. Replacing the "
        f"state by the most similar one of the database every ten steps changes the angle's error then {errors} "
        "(invalid predictions and their remedy, thesis section 3.4)."
    ]


def trained(data: TrainingData, spec: ArmSpec) -> Section:
    """Return the training curves and the spread of the agents."""
    priced, agents, best = PRICE in data.columns, len(data.reward), data.chosen
    sign, paid, won = (-1, "price", "within tolerance at the end") if priced else (1, "reward", "success")
    low, high = sorted(sign * end for end in (data.reward.min(), data.reward.max()))
    text = [
        f"{agents} agents learn at once from different initial weights, because these decide most (thesis section "
        f"5.4.2); the best in a validation is kept. There it has {paid} {sign * data.reward[best]:.2f} a movement "
        f"(all agents {low:.2f} to {high:.2f}) and {data.success[best]:.1%} {won} ({data.success.min():.1%} to "
        f"{data.success.max():.1%})."
    ]
    if "deviation" in data.columns:
        text.append(
            "Shaping lets begin states lie farther from the goal as the agent meets its criterion (thesis section "
            "4.3.2)."
        )
    learned = "How the agents learned; exploring they earn less than tested (over deviations: thesis figure 4.3)."
    if priced:
        text.append(
            "A movement has a price here, for errors, changes of valves and slack muscles, in place of the thesis' "
            "reward; less is better. These simulated movements are harder than those on the arm: they begin wherever "
            "the movement before left the arm, and most follow a reference that jumps or moves. So fewer of them end "
            "within tolerance than goals are settled at on the arm."
        )
        learned = "How the agents learned (prices: no figure in the thesis)."
    pictures = []
    if len(data.columns) > 1:
        curves = training_curves(data.curves, data.columns, data.evaluated, data.chosen, spec)
        pictures.append(Picture(curves, learned))
    return Section("Training in the simulation", text, pictures)


def transferred(data: TransferData, test: Movements | None) -> Section:
    """Return the curves of the transfer."""
    phases = phases_of(data)
    reference = levels(test) if test is not None else {}
    learning = f"learning with a rate of {data.learning_rate:g}" if data.learning_rate else "learning nothing"
    if data.adaptations:
        versions = "one new version" if data.adaptations == 1 else f"{data.adaptations} new versions"
        learning = f"adapting between movements ({versions})"
    return Section(
        "Transfer to the arm",
        (
            f"The controller on the arm: first as it arrives, then {learning}, then as it has become. The step "
            "between the dashed line and the first phase is the reality gap.",
        ),
        (
            Picture(
                transfer_curves(phases, reference),
                "Reward, success, actions and switches on the arm (thesis figures 5.9 to 5.12; as there actions and "
                "switches are those of successful episodes). Averages do not reach over the borders of the phases.",
            ),
        ),
    )


def adapted(data: Adapted, spec: ArmSpec) -> Section:
    """Return how the simulation predicted the arm, when it was found to have changed, and the agent's versions."""
    marks = [CurveMark(event.movement, event.what) for event in data.events]
    happened = data.sentences
    measured = [i for i, name in enumerate(data.quantities) if spec.pressure_sensors or "pressure" not in name]
    squares, names = data.squares[..., measured], [data.quantities[i] for i in measured]
    text = [
        "After every movement the simulation's errors on the arm are compared with those of its fit. Where a "
        "simulation that is fitted to the newest movements predicts others of them better, the agent becomes a new "
        "version; one that earns less than the one before is rolled back."
    ]
    text += [f"{sentence[0].upper()}{sentence[1:]}." for sentence in happened]
    if not happened:
        text.append("The arm was as it had been collected from; the agent stayed as it was.")
    return Section(
        "Adaptation to the arm",
        text,
        (
            Picture(
                adaptation_curves(squares, names, marks, math.sqrt(WatchSettings().allowance)),
                "Error of the simulation on the arm over that of its fit, as moving means of 20 movements; 1 is an "
                "arm that is as it was (no figure in the thesis, whose agent learns while it moves, section 5.5).",
            ),
        ),
    )


def phases_of(data: TransferData) -> list[Phase]:
    """Return the phases with their time counted from the begin of the first episode, without interruptions."""
    phases = data.phases
    start, end = (np.concatenate([getattr(p, name) for p in phases.values()]) for name in ("time_start", "time_end"))
    times = np.split(running_time(start, end), np.cumsum([p.n for p in phases.values()])[:-1])
    return [
        Phase(name, p.reward, p.success, p.actions, p.all_switches, time)
        for (name, p), time in zip(phases.items(), times, strict=True)
    ]


def levels(test: Movements) -> dict[str, float]:
    """Return the levels of the simulation's test that the curves of the transfer are compared with."""
    if test.n == 0:
        return {}
    won = test.success
    found = {"reward": float(test.reward.mean()), "success_rate": float(won.mean())}
    if won.any():
        found |= {"actions": float(test.actions[won].mean()), "switches": float(test.all_switches[won].mean())}
    return found


def demonstrated(demonstrations: tuple[Demonstration, ...], spec: ArmSpec) -> Section:
    """Return the typical movements."""
    pictures = [
        Picture(
            movement(m.shown(spec), m.seconds, tolerance=GOAL_TOLERANCE),
            f"A movement on the arm: {m.name} (compare thesis figures 5.17 to 5.19, which have neither pressures nor "
            f"valve signals). The band is the goal ± {GOAL_TOLERANCE / spec.counts_per_degree:.1f}°; at the dotted "
            "line it is reached and the control ends.",
        )
        for m in demonstrations
    ]
    return Section("Typical movements", ("Angle, pressures and valves of both muscles against time.",), pictures)
