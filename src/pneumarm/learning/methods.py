"""The methods that train agents, in one table, and what is done with an agent of any of them.

A method of your own is a :class:`Method` in a module of yours, say ``MINE`` in ``my_module.py``:

- ``pneumarm train --method my_module:MINE`` uses it; its settings are ``--own.NAME VALUE``.
- An installed package names it as an entry point of the group ``pneumarm.methods`` and then has a short name for it.
- Its agents are saved in files whose kind is ``my_module:MINE`` (:func:`~pneumarm.files.write_arrays`), by which
  :func:`load_agent` finds the method again.

Loading runs code of that module, so a file alone never decides it: the module is imported already (``--method`` of
the command names it, or a program has imported it), or it is an installed entry point. Otherwise the file is refused.
"""

import inspect
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from pneumarm.errors import UnusableInput
from pneumarm.files import kind_of, refuse_code
from pneumarm.learning.agents import Acts, AnyAgent, LooksAhead, SelfTesting
from pneumarm.learning.batched.settings import BatchedSettings
from pneumarm.learning.batched.training import train_batched
from pneumarm.learning.evolution import ESP
from pneumarm.learning.evolution.agent import KIND as EVOLVED
from pneumarm.learning.evolution.agent import EvolvedAgent
from pneumarm.learning.hierarchy import HIERARCHY
from pneumarm.learning.hierarchy.agent import KIND as HIERARCHICAL
from pneumarm.learning.hierarchy.agent import HierarchicalAgent
from pneumarm.learning.imported import KIND as IMPORTED
from pneumarm.learning.imported import ImportedPolicy
from pneumarm.learning.method import Method, TaskName
from pneumarm.learning.online.agent import KIND as ACTION_VALUES
from pneumarm.learning.online.agent import Agent
from pneumarm.learning.online.settings import TrainSettings
from pneumarm.learning.online.training import train_online
from pneumarm.learning.policy.agent import KIND as POLICY
from pneumarm.learning.policy.agent import PolicyAgent, train_policy
from pneumarm.learning.policy.settings import PolicySettings
from pneumarm.learning.servo.agent import KIND as SERVO
from pneumarm.learning.servo.agent import ServoAgent, train_servo
from pneumarm.learning.servo.settings import ServoSettings
from pneumarm.learning.training import Progress, Training
from pneumarm.learning.values import VALUES, ValueAgent
from pneumarm.learning.values.agent import KIND as LEARNED_VALUES
from pneumarm.settings import Settings, Valid, in_words
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.acting import test_acting
from pneumarm.task.begin import BeginStates
from pneumarm.task.environment import environment
from pneumarm.task.movements import TEST, Movements

GROUP = "pneumarm.methods"
"""The group of entry points of installed methods."""
LOOKING_AHEAD = 500
"""Movements of a test that looks ahead; they take seconds."""


def _thesis(name: str) -> Method:
    return Method(TrainSettings, train_online, Agent.load, place="thesis", fixed={"method": name})


METHODS: Mapping[str, Method] = {
    "servo": Method(ServoSettings, train_servo, ServoAgent.load, ("settle", "hold", "track", "reach"), place="servo"),
    "policy": Method(PolicySettings, train_policy, PolicyAgent.load, place="policy"),
    "batched": Method(BatchedSettings, train_batched, Agent.load, place="batched"),
    "hierarchy": HIERARCHY,
    "esp": ESP,
    **VALUES,
    "sarsa": _thesis("sarsa"),
    "q-learning": _thesis("q-learning"),
}
"""A servo, by default; a policy to reach goals; the thesis' nine networks learned in many arms; the thesis' agents
under an upper one, which sets subgoals; an evolved recurrent network; the rules of section 4.2 (:mod:`.values`); the
thesis' own. A method whose settings are those of another and more comes before that."""
_LOADS: Mapping[str, Callable[[Path], AnyAgent]] = {
    SERVO: ServoAgent.load,
    POLICY: PolicyAgent.load,
    ACTION_VALUES: Agent.load,
    HIERARCHICAL: HierarchicalAgent.load,
    EVOLVED: EvolvedAgent.load,
    LEARNED_VALUES: ValueAgent.load,
    IMPORTED: ImportedPolicy.load,
}
"""By kind of file."""


def find_method(name: str) -> Method:
    """Return the method called ``name``: one of :data:`METHODS`, an installed one, or MODULE:NAME of your own.

    The module may lie in the current folder; it is imported.

    Raises:
        UnusableInput: there is no such method.

    """
    if name in METHODS:
        return METHODS[name]
    installed = {entry.name: entry for entry in entry_points(group=GROUP)}
    if name in installed:
        return _imported(installed[name])
    if ":" in name:
        if "" not in sys.path:
            sys.path.insert(0, "")  # a user's module lies in the folder that they call us from
        return _imported(EntryPoint(name, name, GROUP))
    raise UnusableInput(f"method {name!r}: expected {', '.join([*METHODS, *sorted(installed)])} or MODULE:NAME")


def _imported(entry: EntryPoint) -> Method:
    try:
        found = entry.load()
    except (ImportError, AttributeError, ValueError) as error:
        raise UnusableInput(f"method {entry.value}: expected a module and a Method in it; {error}") from error
    if not isinstance(found, Method):
        raise UnusableInput(f"method {entry.value}: expected a pneumarm.learning.Method, got {type(found).__name__}")
    return found


def load_agent(path: Path) -> AnyAgent:
    """Return the agent in ``path``, of whatever method.

    Raises:
        UnusableInput: ``path`` is no agent, is damaged, does not fit together, or is of a method that nobody named.

    """
    kind = kind_of(path)
    if kind in _LOADS:
        return _LOADS[kind](path)
    if kind in (one.value for one in entry_points(group=GROUP)):
        return _imported(EntryPoint(kind, kind, GROUP)).load(path)
    if (known := _already_imported(kind)) is not None:
        return known.load(path)
    if ":" in kind:
        refuse_code(path, "method", kind)
    raise UnusableInput(f"{path}: expected an agent written by pneumarm train, its kind is {kind!r}")


def _already_imported(kind: str) -> Method | None:
    """Return the method MODULE:NAME if it has been imported; nothing runs, not even what modules do when asked."""
    module, _, place = kind.partition(":")
    found: Any = sys.modules.get(module)
    for name in place.split("."):
        found = inspect.getattr_static(found, name, None)
    return found if isinstance(found, Method) else None


@dataclass(frozen=True)
class LearnSettings(Settings):
    """Which method learns, and the settings of each."""

    task: TaskName | None = None
    """What the agent is for.

    settle, hold and track name one and the same agent, which does all three (the default); reach one that reaches
    goals as in the thesis, where flying through one slowly enough counts."""
    method: str | None = None
    """servo, policy, batched, hierarchy, esp, sarsa, q-learning, a rule of section 4.2, or MODULE:NAME.

    batched: the thesis' networks learned in many arms at once; hierarchy: an upper agent sets subgoals of the thesis'
    agents; esp: an evolved recurrent network; sarsa and q-learning: the thesis'; td, monte-carlo, sarsa-lambda,
    q-lambda, actor-critic and dynamic-programming: values on any approximator, by any policy. An installed method has
    a name too. By default servo, and policy to reach."""
    servo: ServoSettings = field(default_factory=ServoSettings)
    """Settings of the method servo."""
    policy: PolicySettings = field(default_factory=PolicySettings)
    """Settings of the method policy."""
    batched: BatchedSettings = field(default_factory=BatchedSettings)
    """Settings of the method batched."""
    thesis: TrainSettings = field(default_factory=TrainSettings)
    """Settings of the methods sarsa and q-learning."""
    own: dict[str, Any] = field(default_factory=dict)
    """Settings of hierarchy, of esp, of a rule of section 4.2, or of a method of your own, as --own.NAME VALUE.

    What has parts is written as JSON: --own.goal [10] or --own.help '{"retry": 0.5}'."""

    def _valid(self) -> Valid:
        _ = self.chosen  # it says what is wrong with the method or with settings of one's own
        own, can = self.found.place == "own", self.found.tasks
        return {
            "task": self.task is None or self.task in can or f"{' or '.join(can)}, what {self.method} is for",
            "own": own or not self.own or "nothing, as the method has options of its own",
        }

    @property
    def found(self) -> Method:
        """The method."""
        return find_method(self.method or ("policy" if self.task == "reach" else "servo"))

    @property
    def chosen(self) -> Any:
        """The settings of the method.

        Raises:
            UnusableInput: the method is one of the user's own and has no such settings.

        """
        method = self.found
        if method.place != "own":
            return replace(getattr(self, method.place), **method.fixed)
        known = [one.name for one in fields(method.settings)]
        if unknown := sorted(self.own.keys() - set(known)):
            raise UnusableInput(
                f"method {self.method}: has no setting {', '.join(unknown)}; it has {', '.join(known)}"
            )
        try:
            own = {name: _of_json(value) for name, value in self.own.items()}
            found = msgspec.convert({**own, **method.fixed}, method.settings, strict=False)
            return replace(found)  # msgspec leaves defaults in the class, where vars() does not see them
        except msgspec.ValidationError as error:
            raise UnusableInput(f"method {self.method}: expected {in_words(error, method.settings)}") from error
        except msgspec.DecodeError as error:
            raise UnusableInput(f"method {self.method}: expected JSON after [ or {{; {error}") from error


def _of_json(value: Any) -> Any:
    """Return ``value``, or where that is text that begins like a list or a table in JSON, what it says."""
    return msgspec.json.decode(value) if isinstance(value, str) and value[:1] in ("[", "{") else value


def train(
    simulation: Simulation,
    begin_states: BeginStates,
    settings: Any = None,
    seed: int = 0,
    *,
    method: Method | None = None,
    progress: Callable[[Progress], None] | None = None,
    checkpoint: Path | None = None,
    threads: int | None = None,
) -> Training[Any]:
    """Train agents by ``method``, by default the built-in one that ``settings`` are of, and return the best.

    The same seed gives the same agents, bit for bit, with any number of ``threads`` (default: one a core). With a
    ``checkpoint`` a killed training goes on from there; the file is left when training is done. A method of your own
    does that if it cares to.

    Raises:
        UnusableInput: begin states and simulation do not fit, or the checkpoint is of another training.

    """
    settings = (method or METHODS["servo"]).settings() if settings is None else settings
    method = method or next((one for one in METHODS.values() if isinstance(settings, one.settings)), None)
    if method is None:
        raise UnusableInput(f"{type(settings).__name__} are the settings of no method here; say of which")
    return method.train(
        simulation, begin_states, settings, seed, progress=progress, checkpoint=checkpoint, threads=threads
    )


def test(
    agent: Acts,
    simulation: Simulation,
    begin_states: BeginStates,
    episodes: int = 10_000,  # noqa: PT028 - this is no test case
    seed: int = 0,  # noqa: PT028
) -> Movements:
    """Let ``agent`` move greedily and without learning, from all begin states to all goals.

    A policy moves as it says at once; what looking ahead adds on an arm is told by :func:`test_ahead`. Begin states
    and goals depend on ``seed`` alone, not on what the agent does, so baselines get the same ones.

    Raises:
        UnusableInput: the agent was made for an arm or a window of another kind, or there is no episode.

    """
    _check_made_for(agent, simulation)
    if isinstance(agent, SelfTesting):
        return agent.test(simulation, begin_states, episodes, (seed, TEST))
    return test_acting(agent.actor(), environment(simulation, begin_states, agent.settings), episodes, (seed, TEST))


test.__test__ = False  # type: ignore[attr-defined]


def test_ahead(
    agent: Acts,
    simulation: Simulation,
    begin_states: BeginStates,
    episodes: int = LOOKING_AHEAD,  # noqa: PT028 - this is no test case
    seed: int = 0,  # noqa: PT028
) -> Movements | None:
    """Let ``agent`` make the first movements of :func:`test` as it makes them on an arm, looking ahead.

    None for an agent that acts on an arm as it does in :func:`test`: there is nothing to add.

    Raises:
        UnusableInput: the agent was made for an arm or a window of another kind, or there is no episode.

    """
    _check_made_for(agent, simulation)
    if not isinstance(agent, LooksAhead):
        return None
    return agent.test_ahead(simulation, begin_states, episodes, (seed, TEST))


test_ahead.__test__ = False  # type: ignore[attr-defined]


def results_with_lookahead(tested: Movements, ahead: Movements | None) -> dict[str, Any]:
    """Return what ``results.json`` holds of :func:`test` and, under ``lookahead``, of :func:`test_ahead`."""
    return {**tested.results(), "lookahead": None if ahead is None else ahead.results()}


def _check_made_for(agent: Acts, simulation: Simulation) -> None:
    if agent.window != simulation.window:
        raise UnusableInput(f"an agent for {agent.window} cannot be tested on a simulation of {simulation.window}")
    scaling, other = agent.scaling, simulation.scaling
    if not all(np.array_equal(getattr(scaling, name), getattr(other, name)) for name in vars(scaling)):
        raise UnusableInput("the agent was trained in another simulation: its inputs are scaled differently")
