"""Controllers that plan, with the arm's true physics or with its learned simulation.

Three of them answer what can be achieved (thesis section 5.5.1: "we do not know what an optimal controller can
achieve"):

========================  ===================  ==========  ==========================================================
controller                plans with           plans       what it is
========================  ===================  ==========  ==========================================================
open loop                 true physics         once        on an arm without noise and jitter: the bound itself
closed loop               true physics         every turn  the same with the arm's sensors and jitter
simulated                 learned simulation   every turn  what planning makes of a simulation, as any baseline may
========================  ===================  ==========  ==========================================================

A planner that knows the true physics and the commands has little to learn from noisy sensors, so it is given the
true state at each reading. What it does not know in closed loop is the noise to come: whether the goal is reached is
judged by noisy readings, turns end late, and the supply fluctuates. In open loop even that fluctuation is foreseen.

Plans of one joint are proven to be the best within their settings. Those of several joints are sought by a guess of
the rest of the way (see :mod:`.agility`): they can be achieved, and a little better ones may be missed. In open loop
a second search, for what is cheaper and without the guess, says how much better they can be at most.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.cycle import missed_turns
from pneumarm.arm.guard import GuardedArm
from pneumarm.arm.seam import Arm, ArmSpec, Reading
from pneumarm.arm.virtual import VirtualArm
from pneumarm.arm.virtual.rollout import capture, physics_of, physics_states
from pneumarm.errors import UnusableInput
from pneumarm.planning.agility import agility_of
from pneumarm.planning.search import (
    CERTAIN,
    Agility,
    Plan,
    PlanProblem,
    PlanSettings,
    Uncertainty,
    find,
    problem,
    tree,
    unknown_agility,
    workspace_of,
)
from pneumarm.random import random_state
from pneumarm.simulation.rollout import look_simulated, simulated_states, simulated_world
from pneumarm.simulation.simulation import Simulation
from pneumarm.task import Reward, StateTracker
from pneumarm.transitions.watch import made_up_readings

_OWN_SUPPLY = 0
"""Seed of the supply's fluctuation in plans that do not foresee the true one."""


_STILL = 2.0
"""Readings of an arm that stands still differ by so much [counts of the thesis' sensors]."""


_PATIENCE = 0.1
"""Time [s] after which a planner with a simulation sees that the arm sticks where the simulation drifts on."""
SIMULATED = PlanSettings(nodes=20_000)
"""Settings with which a decision takes milliseconds at most."""


class Model(Protocol):
    """What a planner plans with: it follows an arm, and can be rolled out from where the arm is."""

    spec: ArmSpec
    world: Any
    states: Any
    """Workspace for a search; the first state is where the arm is."""
    uncertainty: Uncertainty
    """How far readings are from what the model says."""
    agility: Agility | None
    """How fast several joints are; None for one, whose plans are proven to be the best."""
    hasty: Agility | None
    """A guess of it by which plans are sought where the search by the other finds none."""

    def reset(self) -> None:
        """Begin a movement: the next reading is one at rest."""

    def follow(self, reading: Reading) -> None:
        """Put the first state to where the arm is at ``reading``."""

    def commanded(self, valves: NDArray[np.int8]) -> None:
        """Note the ``valves`` (joints, 2) that are set after the last reading."""


class PhysicsModel:
    """The true physics of a virtual arm, from its true state."""

    def __init__(self, arm: Arm, settings: PlanSettings = PlanSettings(), *, foresight: bool = False) -> None:
        """Follow ``arm``, a virtual one, which may stand behind a guard; with ``foresight`` know its supply to come.

        Raises:
            UnusableInput: another kind of arm, whose physics nobody knows.

        """
        inner = arm.arm if isinstance(arm, GuardedArm) else arm
        if not isinstance(inner, VirtualArm):
            raise UnusableInput(f"{arm.spec.name}: not virtual: its true physics are unknown; plan with a simulation")
        self._arm = inner
        self._random = None if foresight else random_state(_OWN_SUPPLY)
        self.spec = inner.spec
        self.world = physics_of(inner)
        self.states = physics_states(self.world, workspace_of(settings, self.spec.joints))
        self.uncertainty = CERTAIN if foresight else _sensor_noise(inner)
        self.agility: Agility | None = None
        self.hasty: Agility | None = None
        if self.spec.joints > 1:
            capture(inner, self.world, self.states, 0)
            self.agility, self.hasty = agility_of(self.world, self.states, self.spec)
        self._due: float | None = None

    def reset(self) -> None:
        """Begin a movement."""
        self._due = None

    def follow(self, reading: Reading) -> None:
        """Copy the arm's state; turns end where the control cycle's do, at equal distances from the first one."""
        capture(self._arm, self.world, self.states, 0)
        if self._random is not None:
            self.states.random[0] = self._random
        period = self.spec.period
        due = reading.time if self._due is None else self._due + period
        due += missed_turns(reading.time - due, period) * period
        self.states.due[0] = self._due = due
        self.states.angle[0], self.states.pressure[0] = reading.angle, reading.pressure

    def commanded(self, valves: NDArray[np.int8]) -> None:
        """Do nothing: the arm knows its valves."""


def _sensor_noise(arm: VirtualArm) -> Uncertainty:
    """Return how far readings of ``arm`` are from those of sensors that only quantise."""
    sensors, period = arm.parameters.sensors, 1e3 * arm.spec.period
    # The variance of a median is pi/2 times that of a mean for many conversions, and not far from it for few.
    share = math.sqrt(math.pi / 2 / sensors.conversions) if sensors.conversions > 1 else 1.0
    angle = share * sensors.angle_noise
    return Uncertainty(angle, math.sqrt(2) * angle / period)


class SimulationModel:
    """A learned simulation, from the state window of what was read."""

    def __init__(self, simulation: Simulation, settings: PlanSettings = PlanSettings()) -> None:
        """Plan with ``simulation``.

        Raises:
            UnusableInput: it was fitted to continuous commands.

        """
        if not simulation.valves:
            raise UnusableInput("the simulation was fitted to continuous commands; a plan needs one fitted to valves")
        self.spec = simulation.spec
        self.world = simulated_world(simulation)
        self.states = simulated_states(self.world, workspace_of(settings, self.spec.joints))
        angle, velocity = simulation.error_std[:, :2].max(axis=0).tolist()
        self.uncertainty = Uncertainty(angle, velocity)
        self.agility: Agility | None = None
        self.hasty: Agility | None = None
        if self.spec.joints > 1:
            look_simulated(self.world, self.states, 0)
            self.agility, self.hasty = agility_of(self.world, self.states, self.spec)
        self._tracker = StateTracker(simulation.window, simulation.scaling)

    def reset(self) -> None:
        """Begin a movement."""
        self._tracker.reset()

    def follow(self, reading: Reading) -> None:
        """Put the first state to the window of the last readings."""
        self.put(self._tracker.reading(reading))

    def put(self, state: NDArray[np.float32]) -> None:
        """Put the first state to the scaled window ``state`` (state_size,)."""
        self.states.x[0, : len(state)] = state
        look_simulated(self.world, self.states, 0)

    def commanded(self, valves: NDArray[np.int8]) -> None:
        """Remember the valves in the window."""
        self._tracker.commanded(valves)


@dataclass
class Planner:
    """A controller that takes the first action of the best plan, and plans again every turn or never.

    Without ``replan`` the first plan is carried out whatever happens, and its last action goes on after its end.
    """

    model: Model
    settings: PlanSettings = field(default_factory=PlanSettings)
    reward: Reward = field(default_factory=Reward)
    replan: bool = True
    patience: int = 0
    """Turns without any effect after which an action is given up, whatever the model says of it; 0 for never."""
    prove: bool = False
    """Whether, where a plan was sought by a guess, it is told by how much another could be better."""
    clock: Callable[[], float] = perf_counter
    """Tells the time of a decision [s]."""
    seconds: list[float] = field(default_factory=list, init=False)
    """How long each decision took [s]."""
    unproven: int = field(default=0, init=False)
    """Plans of which it is not proven that none is better."""
    found: Plan | None = field(default=None, init=False)
    """The last plan."""

    def __post_init__(self) -> None:
        spec = self.model.spec
        self._workspace = tree(self.settings, spec.joints)
        self._problem = problem(
            np.zeros(spec.joints),
            self.reward.on(spec),
            self.settings,
            self.model.uncertainty,
            spec.muscles,
            self.model.agility,
        )
        self._turn = 0
        self._last = -1
        self._still = 0
        self._since: NDArray[np.float64] | None = None

    def warm_up(self) -> None:
        """Plan once from a made-up reading: compiling takes longer than an arm waits for a decision."""
        self.reset(np.full(self.model.spec.joints, sum(self.model.spec.angle_range) / 2))
        self.act(made_up_readings(self.model.spec)[0])
        self.seconds.clear()
        self.unproven = 0

    def reset(self, goal: NDArray[np.float64]) -> None:
        """Begin a movement to ``goal`` (joints,) [counts]."""
        self._problem.goal[:] = goal
        self.model.reset()
        self.found, self._turn, self._last = None, 0, -1
        self._still, self._since = 0, None

    def act(self, reading: Reading) -> NDArray[np.int8]:
        """Return the valves (joints, 2) to set after ``reading``."""
        began = self.clock()
        if self.found is None or self.replan:
            self.model.follow(reading)
        valves = self.choose_valves()
        self.model.commanded(valves)
        self.seconds.append(self.clock() - began)
        return valves

    def choose_valves(self) -> NDArray[np.int8]:
        """Return the valves (joints, 2) to set where the model is."""
        if self.found is None or self.replan:
            may_hold = not self._is_stuck()
            self.found = self._find(self._problem, may_hold)
            if not self.found.reached and self.model.hasty is not None:
                self.found = self._find(self._problem._replace(agility=self.model.hasty), may_hold)
            if self.prove and not self.found.proven:
                unguided = self._problem._replace(agility=unknown_agility(self.model.spec.joints))
                self.found = self._find(unguided, may_hold, self.found)
            self.unproven += not self.found.proven
            self._turn = 0
        plan = self.found.actions
        action = int(plan[min(self._turn, len(plan) - 1)])
        self._turn += 1
        if action != self._last:
            self._last, self._still = action, 0
            self._since = self._read()
        valves: NDArray[np.int8] = self._problem.commands[action].copy()
        return valves

    def _find(self, sought: PlanProblem, may_hold: bool, known: Plan | None = None) -> Plan:
        return find(self.model.world, self.model.states, sought, self._workspace, self._last, may_hold, known)

    def _read(self) -> NDArray[np.float64]:
        """Return angles and pressures where the model is [counts of the thesis' sensors]."""
        states, spec = self.model.states, self.model.spec
        return np.concatenate([states.angle[0] / spec.angle_unit, states.pressure[0].ravel() / spec.pressure_unit])

    def _is_stuck(self) -> bool:
        """Return whether the last action has had no effect for some turns: neither angles nor pressures changed."""
        if self._since is None or not self.patience:
            return False
        if np.abs(self._read() - self._since).max() > _STILL:
            self._still, self._since = 0, self._read()
        else:
            self._still += 1
        return self._still >= self.patience


def physics_planner(
    arm: Arm, reward: Reward = Reward(), settings: PlanSettings = PlanSettings(), *, open_loop: bool = False
) -> Planner:
    """Return the planner with the true physics of ``arm``, a virtual one; in ``open_loop`` it plans once, foreseeing.

    Raises:
        UnusableInput: another kind of arm.

    """
    model = PhysicsModel(arm, settings, foresight=open_loop)
    return Planner(model, settings, reward, replan=not open_loop, prove=open_loop)


def simulated_planner(
    simulation: Simulation, reward: Reward = Reward(), settings: PlanSettings = SIMULATED
) -> Planner:
    """Return the planner with a learned ``simulation``: a controller of an arm that needs no training.

    Raises:
        UnusableInput: the simulation was fitted to continuous commands.

    """
    patience = max(round(_PATIENCE / simulation.spec.period), 1)
    return Planner(SimulationModel(simulation, settings), settings, reward, patience=patience)
