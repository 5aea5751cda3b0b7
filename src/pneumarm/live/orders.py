"""What a page may ask for: one small message each, checked before anything happens.

On the wire an order is JSON whose ``do`` says which it is, such as ``{"do": "goal", "degrees": [20.0]}``.
"""

import math
from itertools import pairwise

import msgspec

from pneumarm.errors import UnusableInput
from pneumarm.live.hand import LONGEST, MOST_POINTS

LARGEST = 1 << 16
"""Most bytes of an order."""


class Order(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="do"):
    """Base of all orders."""


class Beat(Order, frozen=True, tag="beat"):
    """Nothing: the page is still there."""


class Take(Order, frozen=True, tag="take"):
    """Control the arm, or ask who does for it."""


class HandOver(Order, frozen=True, tag="hand-over"):
    """Give control to who has asked for it; to nobody where nobody has."""


class Stop(Order, frozen=True, tag="stop"):
    """Vent everything, and stay so until somebody releases it. Whoever looks on may ask for that."""


class Release(Order, frozen=True, tag="release"):
    """End a stop, or try again after a failure."""


class Relax(Order, frozen=True, tag="relax"):
    """Vent everything until the next goal."""


class Hold(Order, frozen=True, tag="hold"):
    """Stay where the arm is now."""


class GoTo(Order, frozen=True, tag="goal"):
    """Go to these angles [degrees] and hold them."""

    degrees: list[float]


class FollowCurve(Order, frozen=True, tag="draw"):
    """Follow a curve: times [s], rising from 0, and a row of angles [degrees] for each."""

    seconds: list[float]
    degrees: list[list[float]]


class Choose(Order, frozen=True, tag="choose"):
    """Let another controller act."""

    controller: str


class PutBack(Order, frozen=True, tag="put-back"):
    """Make a version of the agent the one that is in use in the run's folder."""

    version: int


class Faults(Order, frozen=True, tag="faults"):
    """Switch a fault of a virtual arm on or off."""

    kind: str
    joint: int
    muscle: int
    on: bool


class Learn(Order, frozen=True, tag="learn"):
    """Do the whole job, from collecting to adapting, and move with what comes of it."""


AnyOrder = (
    Beat | Take | HandOver | Stop | Release | Relax | Hold | GoTo | FollowCurve | Choose | PutBack | Faults | Learn
)
_decoder: msgspec.json.Decoder[AnyOrder] = msgspec.json.Decoder(AnyOrder)


def read_order(text: str | bytes, joints: int) -> AnyOrder:
    """Return the order in ``text`` for an arm with ``joints`` joints.

    Raises:
        UnusableInput: it is none.

    """
    try:
        order = _decoder.decode(text)
    except (msgspec.DecodeError, RecursionError) as error:
        raise UnusableInput(f"expected an order of the page, got something else ({error})") from error
    if isinstance(order, GoTo):
        _check(order.degrees, joints)
    elif isinstance(order, FollowCurve):
        _check_curve(order, joints)
    return order


def _check(degrees: list[float], joints: int) -> None:
    if len(degrees) != joints or not all(map(math.isfinite, degrees)):
        raise UnusableInput(f"a goal needs {joints} finite angle(s), got {degrees}")


def _check_curve(order: FollowCurve, joints: int) -> None:
    times, number = order.seconds, len(order.seconds)
    rising = all(a < b for a, b in pairwise(times))
    if not (2 <= number <= MOST_POINTS and number == len(order.degrees) and times[0] == 0 and rising):
        raise UnusableInput(f"a curve needs 2 to {MOST_POINTS} points at times that rise from 0")
    if not times[-1] <= LONGEST:
        raise UnusableInput(f"a curve lasts for up to {LONGEST:g} s, got {times[-1]:g} s")
    for row in order.degrees:
        _check(row, joints)
