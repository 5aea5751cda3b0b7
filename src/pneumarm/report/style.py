"""The one style of all figures: print quality, readable in grey and by the colour-blind.

The three inks differ in lightness as well as in hue, and every series has its own line style and marker, so that
nothing is told by colour alone. Figures are matplotlib's object-oriented ``Figure``; no global state is left behind.
"""

import functools
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ParamSpec, TypeVar

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, MaxNLocator

from pneumarm.arm.seam import ArmSpec
from pneumarm.drawing.colours import DARK, INK

WIDTH = 7.4
"""Width of every figure [inch]."""
DENSITY = "cividis_r"
"""Colour map of counts: light is few, dark is many, in colour and in grey."""
RASTER_DPI = 170
_MANY = 400  # from so many points on a scatter is stored as pixels inside the SVG
_MOST = 6_000  # points of a scatter; more only blacken it and make the page heavy

_RC: Any = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same figure on every machine
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "axes.labelsize": 8.5,
    "axes.labelcolor": INK,
    "axes.edgecolor": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.fontsize": 8,
    "legend.frameon": True,
    "legend.framealpha": 0.9,
    "legend.edgecolor": "none",
    "lines.linewidth": 1.4,
    "lines.markersize": 4,
    "hatch.linewidth": 0.5,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "svg.fonttype": "path",
    "svg.hashsalt": "pneumarm",  # ids in the SVG must not change from run to run
    "text.parse_math": True,
}


class Described(Figure):
    """A figure with its text alternative."""

    alt: str = ""
    """What it shows, with its main numbers, for those who do not see it."""


_Arguments = ParamSpec("_Arguments")
_Drawn = TypeVar("_Drawn", bound=Figure)


def styled(draw: Callable[_Arguments, _Drawn]) -> Callable[_Arguments, _Drawn]:
    """Let the function ``draw`` build its figure in the style of the report, laid out for good."""

    @functools.wraps(draw)
    def drawn(*args: _Arguments.args, **kwargs: _Arguments.kwargs) -> _Drawn:
        with _style():
            figure = draw(*args, **kwargs)
            _freeze(figure)
            return figure

    return drawn


def _style() -> Any:
    return matplotlib.rc_context(_RC)


def panels(rows: int, columns: int, height: float, **options: Any) -> tuple[Described, Any]:
    """Return a figure ``height`` inches high and its axes, shape (rows, columns)."""
    figure = Described(figsize=(WIDTH, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def svg(figure: Figure) -> str:
    """Return ``figure`` as SVG text; the same figure gives the same text."""
    buffer = io.StringIO()
    with _style():
        figure.set_dpi(RASTER_DPI)
        # Figure.savefig would draw once more for a layout that is fixed already.
        FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None, "Creator": None})
    return buffer.getvalue()


def _freeze(figure: Figure) -> None:
    """Lay ``figure`` out once and for all.

    The layout makes place for tick labels, and the ticks depend on that: they stay what they were when it was made.
    Positions are rounded, because the solver leaves differences in the last bits from call to call, and ids in the
    SVG are made of them.
    """
    engine = figure.get_layout_engine()
    if engine is None:
        return
    engine.execute(figure)
    for axes in figure.axes:
        for axis in (a for part in (axes, *axes.child_axes) for a in (part.xaxis, part.yaxis)):
            if axis.get_scale() != "log":
                axis.set_major_locator(FixedLocator([float(v) for v in axis.get_majorticklocs()]))
    figure.set_layout_engine("none")
    for axes in figure.axes:
        x, y, width, height = (round(float(v), 5) for v in axes.get_position().bounds)
        axes.set_position((x, y, width, height))


@dataclass(frozen=True)
class ObservedQuantity:
    """One of the four quantities of an observation, and how people read it."""

    name: str
    symbol: str
    unit: str
    """Unit for people."""
    per_count: float
    """How many of the unit for people one stored unit is."""

    def in_units(self, prefix: str = "") -> str:
        """Return an axis label in units for people."""
        return f"{prefix}{self.name} [{self.unit}]"


def quantities(spec: ArmSpec) -> tuple[ObservedQuantity, ...]:
    """Return angle, velocity, pressure 1 and pressure 2 for the sensors of ``spec``."""
    angle, pressure = 1 / spec.counts_per_degree, 1 / spec.counts_per_bar
    return (
        ObservedQuantity("angle", r"\theta", "°", angle),
        ObservedQuantity("velocity", r"\omega", "°/s", 1e3 * angle),
        ObservedQuantity(f"{spec.pressure_word} 1", r"p_1", "bar", pressure),
        ObservedQuantity(f"{spec.pressure_word} 2", r"p_2", "bar", pressure),
    )


def of_joint(joint: int, joints: int) -> str:
    """Return " of joint 2" where there is more than one, else nothing."""
    return f" of joint {joint + 1}" if joints > 1 else ""


def scatter(axes: Axes, x: Any, y: Any, **options: Any) -> None:
    """Draw points, thinned out evenly where they are too many; many of them as pixels, to keep the page small."""
    thin = slice(None, None, -(-len(x) // _MOST) or 1)
    x, y = x[thin], y[thin]
    settings = {"s": 5, "color": DARK, "linewidths": 0, "alpha": 0.35, **options}
    axes.scatter(x, y, rasterized=len(x) > _MANY, **settings)


def counts_norm(count: Any) -> LogNorm:
    """Return a logarithmic scale of colours from 1 to the largest ``count``, at least to 2."""
    return LogNorm(1, max(2.0, float(np.max(count))))


def counts_bar(figure: Figure, image: Any, axes: Axes, label: str, **options: Any) -> None:
    """Add a bar of the colours of :func:`counts_norm` with three whole numbers at most: more would overlap."""
    numbers = np.unique(np.geomspace(1, image.norm.vmax, 3).round()).tolist()
    bar = figure.colorbar(image, ax=axes, ticks=FixedLocator(numbers), format="%d", pad=0.02, **options)
    bar.minorticks_off()
    bar.set_label(label)


def whole_ticks(axes: Axes, which: str = "x") -> None:
    """Put ticks of ``axes`` at whole numbers only."""
    axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_major_locator(MaxNLocator(integer=True, nbins="auto", min_n_ticks=1))


def nothing(axes: Axes, why: str) -> None:
    """Say in an empty panel why it is empty."""
    axes.text(0.5, 0.5, why, transform=axes.transAxes, ha="center", va="center", color=INK)


def key(color: str, linestyle: Any = "-", **options: Any) -> Line2D:
    """Return an entry for a legend."""
    return Line2D([], [], color=color, linestyle=linestyle, **options)


def legend_below(figure: Figure, handles: Sequence[Any], labels: Sequence[str]) -> None:
    """Put one legend for all panels below them, where it hides no data."""
    figure.legend(handles, labels, loc="outside lower center", ncols=min(len(handles), 4), frameon=False)
