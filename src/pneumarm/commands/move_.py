"""``pneumarm move``."""

from typing import Annotated

from cyclopts import Parameter

from pneumarm.arm import open_arm
from pneumarm.commands.common import AnyStore, Json, OwnMethod, Settings, live
from pneumarm.commands.goals import read_goals
from pneumarm.console import say, show, table
from pneumarm.control.named import open_tracking
from pneumarm.errors import MovementFailed, UnusableInput
from pneumarm.moving import Moved, MoveSettings, move
from pneumarm.transitions.recorder import recorder


def move_(
    controller: str,
    /,
    *goals: Annotated[str, Parameter(allow_leading_hyphen=True)],
    arm: str,
    seed: int = 0,
    record: AnyStore | None = None,
    method: OwnMethod = None,
    settings: Annotated[MoveSettings, Settings] = MoveSettings(),
    json: Json = False,
) -> None:
    """Move an arm to goals, one after the other, and hold each. If it does not settle at one, it tries again.

    Exit code 1 if it did not settle at a goal in all its tries; it still moves to the goals after that. Exit code 2
    if a line of standard input is no goal; movements made before are still reported. Stiffness at goals is chosen in
    training (``train --servo.stiffness``). Virtual arms report air consumption, and so do others that
    implement ``Arm.air_used``; otherwise it is left out, null with --json.

    Parameters
    ----------
    controller
        The folder of a run, an agent, a controller from ``pneumarm tune``, plan:SIM, which plans in a simulation
        at every control step, or inverse:DB, which goes back from the goals through a recording; neither learns.
    goals
        20deg (from the middle of the range) or 650 (counts); of several joints 20deg,-5deg; x and y of the hand from
        the first hinge 0.20m,-0.30m, where the arm's spec has its links; - for standard input, one a line, where
        empty lines and what follows # are left out.
    arm
        virtual, virtual:seed=N, serial:PORT, simulation:FILE or python:module:callable.
    seed
        Random seed of a virtual arm's noise.
    record
        Store to record into, for ``pneumarm view`` or to learn from; created if it does not exist. What was recorded
        is kept, however the command ends.
    method
        The method that trained the agent, MODULE:NAME, if that is one of your own that is not installed.
    """
    with open_arm(arm, seed) as opened:
        mover, spec, known = open_tracking(controller, opened, settings.tolerance, method=method)
        wanted = read_goals(goals, spec, known)
        made: list[Moved] = []
        unusable: UnusableInput | None = None
        with live(spec) as seen, recorder(record, spec) as keep:
            try:
                for one in move(opened, mover, wanted, settings, seen=seen, record=keep):
                    made.append(one)
                    say(_told(one))
            except UnusableInput as error:
                unusable = error
    # What is printed is printed even where one failed, or was none: it says which.
    result = {"movements": [one.results() for one in made]}
    header = ("goal", "settled after [s]", "rest error [deg]", "overshoot [deg]", "tries", "valve changes", "air [l]")
    show(result, json, lambda: [table(header, [_row(one) for one in made], arm)] if made else [])
    if unusable is not None:
        raise unusable
    failed = [one for one in made if not one.success]
    if failed:
        raise MovementFailed(
            f"{len(failed)} of {len(made)} movements did not settle within {settings.tolerance:g} degrees: to "
            f"{'; '.join(_goal(one) for one in failed)}"
        )


def _told(one: Moved) -> str:
    """Return what is said as soon as a goal is done with; figures are in the table."""
    return f"{_goal(one)}: " + ("settled" if one.success else f"not settled in {one.tries} tries")


def _goal(one: Moved) -> str:
    angles = ", ".join(f"{degrees:z.1f}deg" for degrees in one.goal_degrees)
    if one.goal_xy is None:
        return angles
    x, y = one.goal_xy
    return f"x {x:.3f} m, y {y:.3f} m ({angles})"


def _row(one: Moved) -> tuple[object, ...]:
    settled = "no" if one.time_settled is None else f"{one.time_settled - one.time_start:.2f}"
    rest = ", ".join(f"{e:.2f}" for e in one.rest_error)
    if one.hand_error is not None:
        rest += f" (hand: {1e3 * one.hand_error:.1f} mm)"
    air = None if one.air is None else f"{one.air:.2f}"
    over = ", ".join(f"{e:.1f}" for e in one.overshoot)
    return _goal(one), settled, rest, over, one.tries, one.switches, air
