"""``pneumarm track``."""

from pneumarm.arm import open_arm
from pneumarm.commands.common import AnyStore, Json, OwnMethod, live
from pneumarm.console import show
from pneumarm.control.named import open_tracking
from pneumarm.moving import SECONDS, Tracked, check_seconds, track
from pneumarm.task.reference import check_reachable, parse_reference
from pneumarm.transitions.recorder import recorder


def track_(
    controller: str,
    /,
    *,
    arm: str,
    reference: str,
    seconds: float | None = None,
    unforeseen: bool = False,
    seed: int = 0,
    record: AnyStore | None = None,
    method: OwnMethod = None,
    json: Json = False,
) -> None:
    """Have an arm follow a reference. It first moves to where the reference begins.

    Parameters
    ----------
    controller
        The folder of a run, an agent, a controller from ``pneumarm tune``, plan:SIM, which plans in a simulation
        at every control step, or inverse:DB, which goes back from the goals through a recording; neither learns.
    arm
        virtual, virtual:seed=N, serial:PORT, simulation:FILE or python:module:callable.
    reference
        sine:0.5Hz,20deg, ramp:30deg/s,20deg, minimum-jerk:1s,20deg, steps:FILE.csv, or FILE.csv of time [s] and
        degrees of each joint, 0 in the middle of the range.
    seconds
        For how long; by default as long as a file says, else 20 s.
    unforeseen
        The controller must not look at the reference's future, as if a person gave it by hand.
    seed
        Random seed of a virtual arm's noise.
    record
        Store to record into, for ``pneumarm view`` or to learn from; created if it does not exist. What was recorded
        is kept, however the command ends.
    method
        The method that trained the agent, MODULE:NAME, if that is one of your own that is not installed.
    """
    with open_arm(arm, seed) as opened:
        mover, spec, goals = open_tracking(controller, opened, method=method)
        wanted = parse_reference(reference, spec, known_ahead=not unforeseen)
        lasting = seconds if seconds is not None else wanted.duration or SECONDS
        check_seconds(lasting)
        check_reachable(wanted, lasting, goals.range, spec)
        with live(spec) as seen, recorder(record, spec, {"reference": reference}) as keep:
            followed = track(opened, mover, wanted, lasting, seen=seen, record=keep)
    show(followed.results(), json, lambda: [_told(followed, reference)])


def _told(followed: Tracked, reference: str) -> str:
    errors = ", ".join(f"{error:.2f}°" for error in followed.rms_error)
    air = "" if followed.air is None else f", {followed.air:.2f} l of air"
    return f"{reference}, {followed.seconds:.1f} s: RMS error {errors}, {followed.switches} valve changes{air}"
