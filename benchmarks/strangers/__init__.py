"""Arms as strangers built them, drawn by number from wide distributions; no physics of theirs is pneumarm's own.

``python:benchmarks.strangers:one_7`` is arm 7 with one joint, ``python:benchmarks.strangers:two_7`` one with two.
Numbers 1 to 99 are to develop with. Those from 1000 on are held out: arms to judge on, nothing is developed on them.

python -m benchmarks strangers

says what the first of them are. A file here is a concept, and ``motion.py`` all that is compiled.
"""

from collections.abc import Callable, Iterator

from benchmarks.strangers.arm import Stranger
from benchmarks.strangers.draw import draw_arm

JOINTS = {"one": 1, "two": 2}
LISTED = {"one": 12, "two": 4}
"""How many arms :func:`measure` tells of."""
_COLUMN = 18


def measure() -> Iterator[str]:
    """Say what the first arms to develop with are, a line a joint."""
    told = False
    for kind, count in LISTED.items():
        for number in range(1, count + 1):
            design = draw_arm(number, JOINTS[kind])
            for one in design.about:
                if not told:
                    told = True
                    yield _line(["arm", "rate [Hz]", "valves", *one])
                rate, valves = 1 / design.spec.period, "pulses" if design.spec.pulses else "whole periods"
                yield _line([f"{kind}_{number}", rate, valves, *one.values()])


def _line(values: list[str | float]) -> str:
    """Return a line of the table."""
    said = [f"{value:.3g}" if isinstance(value, float) else value for value in values]
    return "".join(f"{one:{_COLUMN}}" for one in said).rstrip()


def __getattr__(name: str) -> Callable[[], Stranger]:
    """Return what makes the arm called ``one_N`` or ``two_N``."""
    kind, _, number = name.partition("_")
    if kind not in JOINTS or not number.isdecimal():
        raise AttributeError(f"arms here are called one_7 or two_7, not {name}")
    return lambda: Stranger(int(number), JOINTS[kind])
