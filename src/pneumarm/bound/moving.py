"""How far a servo stays below what its arm allows in settling and tracking, and what parts it from there.

The same movements are made in five ways:

    arm             the agent on the arm
    quiet           the agent on the arm without noise of any kind
    physics         the quiet movement, made better with the true physics (:mod:`pneumarm.planning.refine`)
    simulation      the agent's network in the simulation that it has learned in
    simulated       that movement, made better in the simulation

Between arm and quiet lies the noise, between simulation and simulated the learner, and what then is left between
quiet and physics is the error of the model.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from pneumarm.arm import ControlCycle, guarded
from pneumarm.arm.reference import Reference, constant
from pneumarm.arm.virtual import VirtualArm, without_noise
from pneumarm.arm.virtual.rollout import capture, physics_of, physics_states
from pneumarm.learning.agents import goals_of
from pneumarm.learning.servo.agent import ServoAgent
from pneumarm.learning.servo.commands import shortest_share
from pneumarm.moving.movement import played
from pneumarm.moving.settling import settled_at
from pneumarm.planning.refine import Wanted, refined
from pneumarm.settings import Settings
from pneumarm.simulation.arm import SimulationArm
from pneumarm.simulation.noise import NoiseSettings
from pneumarm.simulation.rollout import advance_simulated, look_simulated, simulated_states, simulated_world
from pneumarm.task.tracker import StateTracker

Array = NDArray[np.float64]
Way = Literal["arm", "quiet", "physics", "simulation", "simulated"]
WAYS: tuple[Way, ...] = ("arm", "quiet", "physics", "simulation", "simulated")


@dataclass(frozen=True)
class MovingBoundSettings(Settings):
    """Which movements are made, and how long better ones are sought."""

    goals: Annotated[int, Meta(ge=1, le=100_000)] = 20
    """Goals that are moved to, one after the other."""
    hold: Annotated[float, Meta(ge=1, le=60)] = 2.0
    """For how long each is held [s]."""
    frequencies: tuple[Annotated[float, Meta(gt=0, le=100)], ...] = (0.1, 0.25, 0.5, 1.0, 2.0)
    """Frequencies of the sinusoids that are followed [Hz]."""
    amplitude: Annotated[float, Meta(gt=0, lt=360)] = 20.0
    """Amplitude of the sinusoids about the middle of the goals; less where the arm does not go so far [degrees]."""
    seconds: Annotated[float, Meta(ge=1, le=600)] = 5.0
    """For how long each is followed [s]."""
    sweeps: Annotated[int, Meta(ge=1, le=1000)] = 3
    """How often each command of a movement is made better."""


def measure_moving_bound(
    like: VirtualArm,
    agent: ServoAgent,
    settings: MovingBoundSettings = MovingBoundSettings(),
    *,
    seed: int = 0,
    progress: Callable[[float, float], None] | None = None,
) -> dict[str, Any]:
    """Return the figures of each way to move, under ``settle``, and under ``track`` by frequency.

    Args:
        like: the arm of whose kind others are moved; it is not moved.
        agent: trained for that arm.
        settings: which movements.
        seed: of goals and noise.
        progress: called with what is done and the total.

    """
    random, spec = np.random.default_rng([seed, 6]), agent.spec
    low, high = agent.goal_range.T
    goals = [constant(goal) for goal in goals_of(agent).draw(random, settings.goals)]
    middle, half = (low + high) / 2, (high - low) / 2
    counts = np.minimum(settings.amplitude * spec.counts_per_degree, 0.9 * half)

    def wave(frequency: float) -> Reference:
        return Reference(lambda time: middle + counts * np.sin(2 * np.pi * frequency * max(time, 0.0)))

    total, done = 3 * (len(goals) + len(settings.frequencies)), 0
    errors: dict[Way, list[Array]] = {way: [] for way in WAYS}
    for found in (
        _on_arm(like.like(seed), agent, goals, wave, settings),
        _better_on_arm(like.like(seed, without_noise(like.parameters)), agent, goals, wave, settings, random),
        _better_in_simulation(agent, goals, wave, settings, random),
    ):
        for some in found:
            for way, error in some.items():
                errors[way].append(error / (agent.settings.tolerance * spec.counts_per_degree))
            done += 1
            if progress is not None:
                progress(done, total)
    last = round(1 / spec.period)
    figures: dict[str, Any] = {"settle": {}, "track": {}}
    for way, made in errors.items():
        figures["settle"][way] = _settling(made[: len(goals)], spec.period, last, agent.settings.tolerance)
        figures["track"][way] = {
            f"{frequency:g}": float(np.sqrt((error**2).mean()) * agent.settings.tolerance)
            for frequency, error in zip(settings.frequencies, made[len(goals) :], strict=True)
        }
    return figures


def _settling(errors: list[Array], period: float, last: int, tolerance: float) -> dict[str, float | None]:
    """Return the figures of movements with ``errors`` (steps, joints) in tolerances, one a period."""
    sizes = [np.abs(error).max(axis=1) for error in errors]
    times = [period * np.arange(1, len(one) + 1, dtype=np.float64) for one in errors]
    found = [settled_at(*one, 1.0) for one in zip(times, errors, strict=True)]
    settled = [time for time in found if time is not None]
    return {
        "settled": len(settled) / len(errors),
        "median_seconds": float(np.median(settled)) if settled else None,
        "mean_seconds": float(np.mean(settled)) if settled else None,
        "rest_error_deg": float(np.mean([size[-last:].mean() for size in sizes]) * tolerance),
    }


def _movements(goals: list[Reference], wave: Any, settings: MovingBoundSettings) -> Any:
    """Yield what is asked for, for how long, and for how long the arm is brought there before [s]."""
    for goal in goals:
        yield goal, settings.hold, 0.0
    for frequency in settings.frequencies:
        yield wave(frequency), settings.seconds, settings.hold


def _on_arm(
    arm: VirtualArm, agent: ServoAgent, goals: list[Reference], wave: Any, settings: MovingBoundSettings
) -> Any:
    """Yield the errors (steps, joints) [counts] of the agent on ``arm``."""
    cycle, controller = ControlCycle(guarded(arm)), agent.controller()
    for reference, seconds, before in _movements(goals, wave, settings):
        start = _bring(cycle, controller, reference, before)
        recorded = played(cycle, controller, seconds, reference.at)
        start = recorded.time[0] if start is None else start
        yield {"arm": recorded.angle[1:] - _angles(reference, recorded.time[1:] - start)}


def _better_on_arm(
    arm: VirtualArm,
    agent: ServoAgent,
    goals: list[Reference],
    wave: Any,
    settings: MovingBoundSettings,
    random: np.random.Generator,
) -> Any:
    """Yield the errors (steps, joints) [counts] of the agent on ``arm``, which has no noise, and of better plans."""
    cycle, controller, world = ControlCycle(guarded(arm)), agent.controller(), physics_of(arm)
    for reference, seconds, before in _movements(goals, wave, settings):
        steps = round(seconds / arm.spec.period)
        _bring(cycle, controller, reference, before)
        states = physics_states(world, steps + 2)
        capture(arm, world, states, 0)
        recorded = played(cycle, controller, seconds, reference.at)
        wanted = _wanted(agent, _angles(reference, recorded.time[1:] - recorded.time[0])[:steps])
        refined(world, states, wanted, recorded.command[:steps].astype(np.float64), settings.sweeps, random)
        yield {
            "quiet": recorded.angle[1 : steps + 1] - wanted.reference,
            "physics": states.angle[1 : steps + 1] - wanted.reference,
        }


def _better_in_simulation(
    agent: ServoAgent, goals: list[Reference], wave: Any, settings: MovingBoundSettings, random: np.random.Generator
) -> Any:
    """Yield the errors (steps, joints) [counts] of the agent's network in its simulation, and of better plans."""
    simulation, actor, period = agent.simulation, agent.actor(), agent.spec.period
    world, size = simulated_world(simulation), simulation.window.state_size
    arm = SimulationArm(simulation, noise=NoiseSettings(kind="none"))
    latest = StateTracker(simulation.window, simulation.scaling).reading(arm.read())
    ahead = actor.task.inputs.steps
    for reference, seconds, before in _movements(goals, wave, settings):
        lead, steps = round(before / period), round(seconds / period)
        states = simulated_states(world, lead + steps + 2)
        states.x[0, :size] = latest
        look_simulated(world, states, 0)
        plan = np.zeros((lead + steps, agent.spec.joints, 2))
        for step in range(lead + steps):
            now = (step - lead) * period
            plan[step] = actor.pulses(states.x[step, :size], _angles(reference, now + ahead * period))
            states.x[step + 1] = states.x[step]
            advance_simulated(world, states, step + 1, plan[step])
        latest = states.x[lead + steps, :size].copy()
        own = states.angle[1 + lead : 1 + lead + steps].copy()
        states.x[0] = states.x[lead]
        look_simulated(world, states, 0)
        wanted = _wanted(agent, _angles(reference, period * np.arange(1, steps + 1)))
        refined(world, states, wanted, plan[lead:], settings.sweeps, random)
        yield {
            "simulation": own - wanted.reference,
            "simulated": states.angle[1 : steps + 1] - wanted.reference,
        }


def _bring(cycle: ControlCycle, controller: Any, reference: Reference, seconds: float) -> float | None:
    """Give ``controller`` the ``reference``, which begins after ``seconds`` in which the arm moves to its begin.

    Returns when it begins on the arm's clock [s]; None: with the next reading.
    """
    cycle.arm.make_ready()
    controller.reset(reference.at(0.0))
    if seconds > 0:
        controller.track(Reference(lambda time: reference.at(time - seconds)))
        return float(played(cycle, controller, seconds, lambda time: reference.at(time - seconds)).time[0]) + seconds
    return None


def _angles(reference: Reference, times: Array) -> Array:
    """Return what is wanted at ``times`` (n,) [s], shape (n, joints) [counts]."""
    return np.array([reference.at(float(time)) for time in times])


def _wanted(agent: ServoAgent, reference: Array) -> Wanted:
    spec = agent.spec
    tolerance = np.full(spec.joints, agent.settings.tolerance * spec.counts_per_degree)
    return Wanted(reference, tolerance, agent.task.prices, shortest_share(spec), spec.period)
