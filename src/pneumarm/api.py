"""The front door: what the commands do, as functions. ``import pneumarm`` offers all of it and costs nothing.

An arm is its name, as on the command line (``virtual:seed=7``, ``serial:/dev/ttyACM0``), which is opened and closed
here, or an :class:`~pneumarm.arm.Arm` of yours, which is left open. What one function returns is given to the next as
it is, or as the file it was saved in. Where stderr is a terminal, a bar shows how far it is; elsewhere the logger
``pneumarm`` is told.

A store is a path, or the address of a database on a server: ``postgresql://user@host/database`` or
``mysql://user@host/database``.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:  # what these need is imported when they are called
    from numpy.typing import ArrayLike

    from pneumarm.address import StoreAddress
    from pneumarm.arm import Arm
    from pneumarm.arm.controller import TrackingController
    from pneumarm.arm.reference import Reference
    from pneumarm.classical import Tuned, TuneSettings
    from pneumarm.control.loaded import LoadedController
    from pneumarm.control.monitor import Mode
    from pneumarm.learning import AnyAgent, LearnSettings, Training
    from pneumarm.moving import Moved, MoveSettings, Tracked
    from pneumarm.simulation import FitSettings, Simulation, StoreFit
    from pneumarm.task import Movements
    from pneumarm.transitions import CollectResult, CollectSettings

    Made: TypeAlias = str | Path | AnyAgent | Tuned
    """What moves an arm: an agent, a tuned controller, the file of one, or ``plan:SIM``."""


def open_arm(name: str, seed: int = 0) -> "Arm":
    """Return the arm called ``name``; it is a context manager that closes itself. See :func:`pneumarm.arm.open_arm`.

    Raises:
        UnusableInput: no arm has this name.

    """
    from pneumarm.arm import open_arm

    return open_arm(name, seed)


def collect(
    arm: "Arm | str",
    db: "StoreAddress",
    transitions: int | None = None,
    seed: int = 0,
    settings: "CollectSettings | None" = None,
    *,
    monitor: "Mode" = "stop",
) -> "CollectResult":
    """Make ``arm`` move about and record it in the store ``db`` until that holds so many ``transitions``.

    Without a number it goes on until more would not make a simulation better. A second call goes on. What was wrong
    meanwhile is said on stderr, and nothing is learned from it unless ``monitor`` is ``warn`` or ``off``.

    Raises:
        UnusableInput: fewer than 1,000 transitions, or ``db`` is the store of another arm or another collection.
        ArmFailure: the arm failed; what was stored before stays.

    """
    from pneumarm.console import say
    from pneumarm.control import Monitor
    from pneumarm.control.condition import collected_results, complaints
    from pneumarm.progress import progress
    from pneumarm.simulation.enough import collect_enough
    from pneumarm.transitions import FEWEST_TRANSITIONS, Store, collect, require_enough

    if transitions is not None:
        require_enough(transitions)
    with (
        _opened(arm, seed) as opened,
        Store.for_arm(db, opened.spec) as store,
        progress("collecting") as report,
    ):
        watch = Monitor(opened.spec, mode=monitor)

        def record(wanted: int) -> "CollectResult":
            exact = transitions is not None
            return collect(opened, store, wanted, seed, progress=report, settings=settings, watch=watch, exact=exact)

        if transitions is None:
            say(collect_enough(record, store)["verdict"])
        result = record(transitions or FEWEST_TRANSITIONS)
    for line in complaints(collected_results(result, watch), "collecting"):
        say(line)
    return result


def fit(db: "StoreAddress", out: str | Path | None = None, settings: "FitSettings | None" = None) -> "StoreFit":
    """Fit a simulation to the store ``db``; write it to ``out``, if given.

    ``.simulation`` of what it returns is the simulation, ``.results()`` says how good that is.

    Raises:
        UnusableInput: too little is stored, or ``out`` cannot be written.

    """
    from pneumarm.files import require_folder
    from pneumarm.progress import progress
    from pneumarm.simulation import fit_store
    from pneumarm.transitions import Store

    if out is not None:
        require_folder(Path(out))
    with Store.open(db) as store, progress("fitting") as report:
        fitted = fit_store(store, settings, progress=report)
    if out is not None:
        fitted.simulation.save(out)
    return fitted


def train(
    simulation: "Simulation | StoreFit | str | Path",
    db: "StoreAddress",
    out: str | Path | None = None,
    seed: int = 0,
    settings: "LearnSettings | None" = None,
) -> "Training[Any]":
    """Train an agent in ``simulation`` from the resting states in the store ``db``; write it to ``out``, if given.

    ``.agent`` of what it returns is the agent. ``settings`` say what it is for and how it learns:
    ``LearnSettings(task="reach")``, ``LearnSettings(servo=ServoSettings(tolerance=0.5))``.

    Raises:
        UnusableInput: simulation and store do not fit together, or ``out`` cannot be written.

    """
    from pneumarm.files import require_folder
    from pneumarm.learning import LearnSettings, train
    from pneumarm.progress import progress
    from pneumarm.task import begin_states
    from pneumarm.transitions import Store

    if out is not None:
        require_folder(Path(out))
    learn, trained_in = settings or LearnSettings(), _simulation(simulation)
    with Store.open(db) as store:
        begin = begin_states(store, trained_in.window, trained_in.scaling, trained_in.spec)
    with progress("training") as report:
        training = train(
            trained_in,
            begin,
            learn.chosen,
            seed,
            method=learn.found,
            progress=lambda now: report(round(1000 * now.share), 1000),
        )
    if out is not None:
        training.agent.save(Path(out))
    return training


def test(
    agent: "AnyAgent | str | Path",
    simulation: "Simulation | StoreFit | str | Path",
    db: "StoreAddress",
    episodes: int = 10_000,  # noqa: PT028 - this is no test case
    seed: int = 0,  # noqa: PT028
) -> "Movements":
    """Let ``agent`` move in ``simulation`` from the resting states in ``db``; ``.results()`` says how well it did.

    Raises:
        UnusableInput: they do not fit together.

    """
    from pneumarm.learning import test
    from pneumarm.task import begin_states
    from pneumarm.transitions import Store

    tested_in = _simulation(simulation)
    with Store.open(db) as store:
        begin = begin_states(store, tested_in.window, tested_in.scaling, tested_in.spec)
    return test(_agent(agent), tested_in, begin, episodes, seed)


test.__test__ = False  # type: ignore[attr-defined]


def move(
    controller: "Made",
    arm: "Arm | str",
    goals: "Sequence[ArrayLike | str] | None" = None,
    *,
    goals_deg: "Sequence[ArrayLike] | None" = None,
    goals_xy: "Sequence[ArrayLike] | None" = None,
    seed: int = 0,
    settings: "MoveSettings | None" = None,
    record: "StoreAddress | None" = None,
) -> "list[Moved]":
    """Move ``arm`` to one goal after the other, hold each, and return what came of each.

    Args:
        controller: an agent, a tuned controller, the file of one, or ``plan:SIM``.
        arm: which one; not yet guarded.
        goals: numbers, one a joint [counts], or text as on the command line: ``["20deg", "0.20m,-0.30m"]``.
        goals_deg: the same in degrees from the middle of the range, in place of ``goals``: ``[20, -5]``.
        goals_xy: where the hand is to be [m], in place of either: ``[(0.2, -0.3)]``, see :mod:`pneumarm.arm.hand`.
        seed: of a virtual arm's noise.
        settings: how long each is held, how often it is tried, how near is there.
        record: store to add every try to as it happens, made if there is none; what was recorded is kept however
            this ends.

    Raises:
        UnusableInput: the controller or the store is for another arm, or the arm has not been seen to reach a goal.

    """
    from pneumarm.errors import UnusableInput
    from pneumarm.moving import MoveSettings, move
    from pneumarm.task.goals import Goal, goal_at, goal_in_counts, goal_of
    from pneumarm.transitions.recorder import recorder

    if sum(given is not None for given in (goals, goals_deg, goals_xy)) != 1:
        raise UnusableInput(
            "expected goals in one way: in counts (goals=[650]), in degrees (goals_deg=[20]) or as x and y of the "
            "hand in metres (goals_xy=[(0.2, -0.3)])"
        )
    how = settings or MoveSettings()
    with _opened(arm, seed) as opened:
        mover, spec, known = _tracking(controller, opened, how.tolerance)

        def meant(one: Any, before: "Goal | None") -> "Goal":
            if goals_xy is not None:
                return goal_at(one, spec, known, before)
            if isinstance(one, str):
                return goal_of(one, spec, known, before)
            counts, degrees = (one, None) if goals is not None else (None, one)
            return Goal(goal_in_counts(counts, degrees, spec, known))

        wanted: list[Goal] = []
        for given in (goals, goals_deg, goals_xy):
            for one in () if given is None else given:
                wanted.append(meant(one, wanted[-1] if wanted else None))
        with recorder(record, spec) as keep:
            return list(move(opened, mover, wanted, how, record=keep))


def track(
    controller: "Made",
    arm: "Arm | str",
    reference: "Reference | str",
    seconds: float | None = None,
    *,
    seed: int = 0,
    record: "StoreAddress | None" = None,
) -> "Tracked":
    """Have ``arm`` follow ``reference`` for so many ``seconds``, by default 20 or as long as its file is.

    ``reference`` is a name such as ``sine:0.5Hz,20deg`` or one of your own:
    ``Reference(lambda time: counts)``, see :class:`pneumarm.arm.reference.Reference`. What is done is added to the
    store ``record``, if given, as it happens, and kept however this ends.

    Raises:
        UnusableInput: the controller or the store is for another arm, or the arm has not been seen to reach so far.

    """
    from pneumarm.moving import SECONDS, check_seconds, track
    from pneumarm.task.reference import check_reachable, parse_reference
    from pneumarm.transitions.recorder import recorder

    with _opened(arm, seed) as opened:
        mover, spec, known = _tracking(controller, opened)
        wanted = parse_reference(reference, spec) if isinstance(reference, str) else reference
        lasting = seconds if seconds is not None else wanted.duration or SECONDS
        check_seconds(lasting)
        check_reachable(wanted, lasting, known.range, spec)
        info = {"reference": reference} if isinstance(reference, str) else {}
        with recorder(record, spec, info) as keep:
            return track(opened, mover, wanted, lasting, record=keep)


def tune(
    kind: str,
    arm: "Arm | str",
    out: str | Path | None = None,
    seed: int = 0,
    settings: "TuneSettings | None" = None,
) -> "Tuned":
    """Tune a classical controller on ``arm``: pid, scheduled, pwm or sliding; write it to ``out``, if given.

    It takes 20 minutes of the arm's time, or as long as ``TuneSettings(seconds=...)`` says.

    Raises:
        UnusableInput: there is no such kind, the time is too short, or ``out`` cannot be written.

    """
    from pneumarm.classical import TuneSettings, require_time, tune
    from pneumarm.files import require_folder
    from pneumarm.progress import progress

    if out is not None:
        require_folder(Path(out))
    with _opened(arm, seed) as opened, progress("tuning") as report:
        require_time(opened.spec, settings or TuneSettings())
        tuned = tune(kind, opened, settings or TuneSettings(), seed, report)
    if out is not None:
        tuned.save(Path(out))
    return tuned


def load_controller(file: str | Path) -> "LoadedController":
    """Return the controller in ``file``, a greedy agent or a tuned one; the folder of a run gives its agent.

    ``reset(goal=650)`` or ``reset(goal_deg=20)`` begins a movement, then ``act(reading)`` gives the valves for each
    control period; one that follows references has ``track(reference)`` too. It has made its first turns when it is
    returned: an arm that waits for it waits for nothing to be compiled.

    Raises:
        UnusableInput: ``file`` is neither, or is damaged.

    """
    from pneumarm.classical import is_tuned, load_tuned
    from pneumarm.control.agent import controller_of, warm_up
    from pneumarm.control.loaded import loaded
    from pneumarm.control.open_agent import open_agent
    from pneumarm.learning.agents import goals_of
    from pneumarm.transitions.goals import Goals

    path = Path(file)
    if is_tuned(path):
        tuned = load_tuned(path)
        return loaded(tuned.controller(), tuned.spec, Goals.of(tuned.goal_range))
    agent = open_agent(path)
    warm_up(agent)
    return loaded(controller_of(agent), agent.spec, goals_of(agent))


@contextmanager
def _opened(arm: "Arm | str", seed: int) -> "Iterator[Arm]":
    """Give ``arm``; one that is named is opened and closed again."""
    if not isinstance(arm, str):
        yield arm
        return
    with open_arm(arm, seed) as opened:
        yield opened


def _simulation(given: "Simulation | StoreFit | str | Path") -> "Simulation":
    from pneumarm.simulation import Simulation, StoreFit

    if isinstance(given, StoreFit):
        return given.simulation
    return given if isinstance(given, Simulation) else Simulation.load(given)


def _agent(given: "AnyAgent | str | Path") -> "AnyAgent":
    from pneumarm.control.open_agent import open_agent

    return open_agent(Path(given)) if isinstance(given, str | Path) else given


def _tracking(given: "Made", arm: "Arm", tolerance: float = 1.0) -> "tuple[TrackingController, Any, Any]":
    from pneumarm.control.named import open_tracking, tracking_for

    if isinstance(given, str | Path):
        return open_tracking(str(given), arm, tolerance)
    return tracking_for(given, arm, tolerance)
