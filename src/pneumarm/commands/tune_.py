"""``pneumarm tune``."""

from pathlib import Path
from typing import Annotated

from pneumarm.arm import open_arm
from pneumarm.classical import TuneSettings, require_time, tune
from pneumarm.commands.common import Json, Settings, move_command
from pneumarm.console import say, show, table
from pneumarm.files import require_folder
from pneumarm.progress import progress


def tune_(
    kind: str,
    /,
    *,
    arm: str,
    out: Path,
    seed: int = 0,
    settings: Annotated[TuneSettings, Settings] = TuneSettings(),
    json: Json = False,
) -> None:
    """Tune a classical controller on an arm: measure a static map and filling rates, then try gains on movements.

    The first takes some 150 s of the arm's time a joint; what is left of ``--seconds`` is for gains.

    Parameters
    ----------
    kind
        pid: a PID loop on the angle over loops on the pressures, with feed-forward through the static map; scheduled:
        the same with gains scheduled over the angle; pwm: PID by pulse-width modulation; sliding: sliding mode over
        the nine actions.
    arm
        virtual, virtual:seed=N, serial:PORT or python:module:callable.
    out
        File for the controller, JSON.
    seed
        Random seed of what is tried and of a virtual arm's noise.
    """
    require_folder(out)
    with open_arm(arm, seed) as opened, progress("tuning") as report:
        require_time(opened.spec, settings)
        tuned = tune(kind, opened, settings, seed, report)
    tuned.save(out)
    if tuned.is_as_it_began:
        say(
            f"{tuned.seconds:.0f} s of the arm's time were enough to calibrate it, not to find better gains than "
            "those that tuning begins with; more --seconds may find some"
        )
    say(f"controller: {out}; move the arm by it with {move_command(out, arm, tuned.spec, tuned.goal_range)}")
    gains = dict(vars(tuned.gains))
    low, high = tuned.spec.degrees(tuned.goal_range).T
    result = {
        "kind": kind,
        "seconds": tuned.seconds,
        "cost": tuned.cost,
        "gains": gains,
        "goal_range_deg": list(map(list, zip(low.tolist(), high.tolist(), strict=True))),
    }
    rows = [("arm time [s]", tuned.seconds), ("cost", tuned.cost if tuned.cost >= 0 else None), *gains.items()]
    show(result, json, lambda: [table((kind, ""), rows, arm)])
