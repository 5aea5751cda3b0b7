"""A servo as one self-contained file of C99, for a program or a board that has no Python."""

from importlib import resources

import numpy as np
from numpy.typing import ArrayLike

from pneumarm.learning.servo.agent import ServoAgent
from pneumarm.learning.servo.commands import WHOLE
from pneumarm.learning.servo.inputs import input_size

_PLACE = "/* PARAMETERS */"
_A_LINE = 6
"""Numbers in a line of the file."""


def as_c(agent: ServoAgent) -> str:
    """Return the policy of ``agent`` with its scaling as C: ``servo_act`` and all that it needs."""
    window, scaling, task = agent.window, agent.scaling, agent.task
    seen, made, sizes = task.inputs, task.commands, agent.sizes
    numbers = {
        "JOINTS": window.joints,
        "HISTORY": window.history,
        "OBSERVED": window.observation_size,
        "STATE": window.state_size,
        "PREVIEWS": len(seen.steps),
        "LAYERS": len(sizes) - 1,
        "WIDEST": max(input_size(seen), *sizes),
    }
    whole = min(float(WHOLE), 1 - made.shortest / 2)
    shares = {"DEAD": made.dead, "SHORTEST": made.shortest, "STEP": made.step, "WHOLE": whole}
    lines = [
        f"/* For {_safe(agent.spec.name)}, {1 / agent.spec.period:g} Hz, {agent.spec.counts_per_degree:g} counts per "
        f"degree, {agent.spec.counts_per_bar:g} counts per bar. */",
        *(f"#define SERVO_{name} {value}" for name, value in numbers.items()),
        *(f"#define SERVO_{name} {_float(value)}" for name, value in shares.items()),
        f"const int servo_ahead[SERVO_PREVIEWS] = {{{', '.join(str(step) for step in seen.steps)}}};",
        f"static const int servo_sizes[SERVO_LAYERS + 1] = {{{', '.join(map(str, sizes))}}};",
        _array("servo_offset[SERVO_OBSERVED]", scaling.observation_offset),
        _array("servo_scales[SERVO_OBSERVED]", scaling.observation_scale),
        _array("servo_command_scale[2 * SERVO_JOINTS]", scaling.command_scale),
        _array("servo_rate[SERVO_JOINTS]", seen.rate),
        _array("servo_tolerances[SERVO_JOINTS]", seen.tolerances),
        f"static const float servo_inlet[SERVO_JOINTS][2] = {{{', '.join(_braced(row) for row in made.inlet)}}};",
        _array(f"servo_weights[{agent.policy.size}]", agent.policy),
    ]
    template = resources.files("pneumarm.learning.servo").joinpath("servo.c").read_text(encoding="utf-8")
    return template.replace(_PLACE, "\n".join(lines))


def _array(name: str, values: ArrayLike) -> str:
    numbers = [_float(value) for value in np.asarray(values, np.float32).ravel().tolist()]
    rows = [", ".join(numbers[i : i + _A_LINE]) for i in range(0, len(numbers), _A_LINE)]
    return f"static const float {name} = {{\n    " + ",\n    ".join(rows) + "};"


def _braced(values: ArrayLike) -> str:
    return f"{{{', '.join(_float(value) for value in np.asarray(values, np.float32).tolist())}}}"


def _float(value: float) -> str:
    """Return a number of single precision as C writes it, with all its digits."""
    text = np.format_float_scientific(np.float32(value), unique=True, trim="0")
    return f"{text}f"


def _safe(name: str) -> str:
    """Return a name as it may stand in a comment of C."""
    return "".join(one for one in name if one.isprintable()).replace("*/", "* /")
