"""``pneumarm collect``."""

from typing import Annotated

from pneumarm.arm import ArmSpec, open_arm
from pneumarm.commands.common import AnyStore, Json, Monitoring, OwnMethod, Settings
from pneumarm.console import say, show, table
from pneumarm.control import Monitor, open_controller
from pneumarm.control.condition import LINK, collected_results, complaints
from pneumarm.progress import progress
from pneumarm.simulation.enough import EnoughSettings, collect_enough
from pneumarm.transitions import FEWEST_TRANSITIONS, CollectResult, CollectSettings, Store, collect, require_enough

_COMPRESSED = 1.1
"""So much above the limit is normal: the joint that moves compresses the air in closed muscles."""


def collect_(
    arm: str,
    db: AnyStore,
    /,
    *,
    transitions: int | None = None,
    seed: int = 0,
    controller: str = "random",
    method: OwnMethod = None,
    monitor: Monitoring = "stop",
    settings: Annotated[CollectSettings, Settings] = CollectSettings(),
    enough: EnoughSettings = EnoughSettings(),
    json: Json = False,
) -> None:
    """Make an arm move about and record it, sequence after sequence; a second call goes on.

    Parameters
    ----------
    arm
        virtual, virtual:seed=N, serial:PORT, simulation:FILE or python:module:callable.
    db
        The store; created if it does not exist. A file, or postgresql://user@host/database or
        mysql://user@host/database.
    transitions
        How many to record in all, those that a fault spoils not counted (thesis section 3.2.2: 200,000, two hours);
        the last sequence is cut short for that. By default it goes on until more would not make a simulation better.
    seed
        Seed of the random begin states and actions, and of a virtual arm's noise.
    controller
        What acts: random, keyboard, a CSV file of valves, or an agent (thesis section 3.2.2).
    method
        The method that trained the agent, MODULE:NAME, if that is one of your own that is not installed.
    """
    if transitions is not None:
        require_enough(transitions)
    with (
        open_arm(arm, seed) as opened,
        open_controller(controller, opened, method) as player,
        Store.for_arm(db, opened.spec) as store,
        progress("collecting") as report,
    ):
        watch = Monitor(opened.spec, mode=monitor)

        def record(wanted: int) -> CollectResult:
            return collect(
                opened,
                store,
                wanted,
                seed,
                progress=report,
                settings=settings,
                controller=player,
                watch=watch,
                exact=transitions is not None,
            )

        judged = None if transitions is not None else collect_enough(record, store, enough)
        result = record(transitions or FEWEST_TRANSITIONS)
    results = collected_results(result, watch)
    if judged is not None:
        results["enough"] = judged
        say(judged["verdict"])
    for line in complaints(results, "collecting"):
        say(line)
    above = _above_limit(float(opened.spec.bar(result.peak_pressure).max()), opened.spec)
    show(results, json, lambda: [table(("collected", ""), _rows(result, opened.spec)), *above])


def _above_limit(peak: float, spec: ArmSpec) -> list[str]:
    """Return what a ``peak`` [bar] above the limit means; nothing where it is not above, or not measured."""
    if not spec.pressure_sensors or peak <= spec.max_pressure:
        return []
    words = f"The highest pressure, {peak:.2f} bar, is above the limit of {spec.max_pressure:g} bar. "
    if peak <= _COMPRESSED * spec.max_pressure:
        return [f"{words}That is normal: inlets close at the limit, but a moving joint compresses closed muscles."]
    return [f"{words}A moving joint compresses closed muscles, but rarely so much: call pneumarm arm check."]


def _rows(result: CollectResult, spec: ArmSpec) -> list[tuple[str, str]]:
    peaks = spec.bar(result.peak_pressure).ravel()
    return [
        ("transitions", f"{result.transitions:,}"),
        ("sequences", f"{result.sequences:,}"),
        ("time of the arm [s]", f"{result.seconds:,.1f}"),
        ("time of this call [s]", f"{result.wall_seconds:,.1f}"),
        (f"highest {spec.pressure_word}s [bar]", ", ".join(f"{peak:.2f}" for peak in peaks)),
        ("the guard", str(result.interventions)),
        ("missed deadlines", f"{result.missed_deadlines:,}"),
        *((LINK.get(name, name), f"{count:,}") for name, count in result.link.items()),
        *((f"rows marked: {reason}", f"{rows:,}") for reason, rows in result.marked.items()),
    ]
