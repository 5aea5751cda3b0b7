"""The errors that pneumarm raises on purpose.

Every message says what was expected, what came, and what to do; the command line prints it as one line.
"""

import re

_LONG_WORD = re.compile(r"(?<!\S)(\S{60})\S{40,}(\S{30})")
_LONGEST = 1000  # characters of a message: what a file holds may be repeated in it, and can be of any length


class PneumarmError(Exception):
    """Base of all errors raised on purpose; ``exit_code`` is what the command line exits with."""

    exit_code = 1

    def __init__(self, message: object = "") -> None:
        super().__init__(shortened(str(message)))


def shortened(message: str, longest: int = _LONGEST) -> str:
    """Return ``message`` without what is in the middle of its long words, and of itself if it is over ``longest``."""
    message = _LONG_WORD.sub(r"\1...\2", message)
    return message if len(message) <= longest else f"{message[: longest - 205]} ... {message[-200:]}"


class UnusableInput(PneumarmError):  # noqa: N818 - reads as a sentence where it is raised
    """A file, a setting or an argument that cannot be used: nothing was moved, nothing was written."""

    exit_code = 2


class ArmFailure(PneumarmError):  # noqa: N818
    """The arm stopped answering or answered nonsense while it was in use."""


class LineLost(ArmFailure):
    """The line to the arm was silent, or the arm was vented because it heard nothing; nobody has to look at it.

    Who moves an arm goes on afterwards, see :meth:`pneumarm.arm.guard.GuardedArm.despite_losses`.
    """


class ControllerFailure(PneumarmError):  # noqa: N818
    """A controller went on giving decisions that cannot be used; the arm is vented."""


class ArmUnsound(PneumarmError):  # noqa: N818
    """A check-up that was asked to be strict found something wrong with the arm."""


class MovementFailed(PneumarmError):  # noqa: N818
    """A movement did not come to rest at its goal, after all its tries."""
