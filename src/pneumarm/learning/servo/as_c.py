"""A servo as one self-contained file of C99, for a program or a board that has no Python."""

from importlib import resources

from pneumarm.learning.servo.agent import ServoAgent
from pneumarm.learning.servo.board import (
    BoardController,
    act_board,
    ask_board,
    begin_board,
    see_board,
)
from pneumarm.learning.servo.networks import run_network
from pneumarm.learning.servo.quantised import Quantised, run_quantised
from pneumarm.learning.servo.translate import Array, Constant, Kept, Translator

_HELPERS = {
    "min_{name}": "{{\n\treturn a < b ? a : b;\n}}",
    "max_{name}": "{{\n\treturn a > b ? a : b;\n}}",
    "abs_{name}": "{{\n\treturn a < 0 ? -a : a;\n}}",
    "floor_{name}": "{{\n\tint whole = (int)a;\n\treturn ({kind})(whole > a ? whole - 1 : whole);\n}}",
    "round_{name}": "{{ /* half to even, as IEEE 754 and Python do */\n\tint whole = (int)(a + ({kind})0.5);\n"
    "\treturn ({kind})(whole % 2 && ({kind})whole - a == ({kind})0.5 ? whole - 1 : whole);\n}}",
}
"""What Python has built in, of numbers that are not negative where they are rounded to whole ones."""
_KINDS = {"int": "int", "int32": "int32_t", "float": "float", "real": "real"}


def as_c(agent: ServoAgent, quantised: Quantised | None = None) -> str:
    """Return all that acts of ``agent`` as C: ``servo_act`` and what it needs, ``quantised`` or in floats."""
    controller, whole, spec = BoardController(agent, quantised), Translator(), agent.spec
    joints, path = spec.joints, (controller.path_length, spec.joints)
    servo, board = Constant(controller.parameters, "servo"), Kept(controller.state, "board")
    angle, pressure, wanted = (Array("float64", shape) for shape in ((joints,), (joints, 2), path))
    run = run_network if quantised is None else run_quantised
    network, units = Constant(controller.network, "network"), Kept(controller.units, "units")
    whole.function(begin_board, servo, board)
    whole.function(ask_board, servo, board)
    whole.function(see_board, servo, board, angle, pressure, wanted, "bool")
    whole.function(run, network, _field(board, "inputs"), units, _field(board, "said"))
    whole.function(act_board, servo, board, pressure, pressure)
    written = whole.text()
    if quantised is not None:
        written = _with_products_by_hand(written)
    numbers = {
        "JOINTS": joints,
        "PATH": path[0],
        "PERIOD": spec.period,
        "COUNTS_PER_DEGREE": spec.counts_per_degree,
        "MIDDLE": sum(spec.angle_range) / 2,
        "LOWEST": float(agent.goal_range[0, 0]),
        "HIGHEST": float(agent.goal_range[0, 1]),
        "MOST_PRESSURE": spec.max_pressure_counts,
        "COUNTS_PER_BAR": spec.counts_per_bar,
        "MOST_INFLATION": spec.max_inflation,
    }
    parts = [
        f"/* For {_safe(spec.name)}, {1 / spec.period:g} Hz, {spec.counts_per_degree:g} counts per degree, "
        f"{spec.counts_per_bar:g} counts per bar. */",
        *(f"#define SERVO_{name} {value!r}" for name, value in numbers.items()),
        *(_helper(name, body, kind) for name, body in _HELPERS.items() for kind in _KINDS),
    ]
    parts = [one for one in parts if not one.startswith("static") or f"{one.split('(')[0].split()[-1]}(" in written]
    template = resources.files("pneumarm.learning.servo").joinpath("servo.c").read_text(encoding="utf-8")
    text = template.replace("/* PARAMETERS */", "\n".join([*parts, written]))
    return text.replace("/* NETWORK */", run.__name__)


def _with_products_by_hand(written: str) -> str:
    """Return it with sums of products that may be other ones: a board's, where its compiler makes slow code."""
    head = "/* Return the sum of count products"
    begin, end = written.index(head), written.index("/*", written.rindex(head) + 2)
    own = written[begin:end].rstrip()
    return f"{written[:begin]}#ifdef SERVO_PRODUCTS\n#include SERVO_PRODUCTS\n#else\n{own}\n#endif\n\n{written[end:]}"


def _field(of: Kept, name: str) -> Kept:
    return Kept(getattr(of.value, name), f"{of.name}_{name}")


def _helper(name: str, body: str, short: str) -> str:
    kind, takes = _KINDS[short], "a, {kind} b" if "return a < b" in body or "return a > b" in body else "a"
    head = f"static {kind} {name.format(name=short)}({kind} {takes.format(kind=kind)})"
    return f"{head}\n" + body.format(kind=kind)


def _safe(name: str) -> str:
    """Return a name as it may stand in a comment of C."""
    return "".join(one for one in name if one.isprintable()).replace("*/", "* /")
