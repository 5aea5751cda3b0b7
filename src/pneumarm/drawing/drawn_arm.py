"""How an arm is drawn, everywhere: links, pulleys, muscles that swell with their pressure, valves that light up.

Lengths are millimetres, y points down. At 0 degrees the arm hangs down; higher angles turn it to the right, where
muscle 1 pulls. Where a joint has one muscle, a spring is drawn in place of the other.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.drawing.colours import DARK, INK, LIGHT, MIDDLE

Array = NDArray[np.float64]

PROPORTIONS = {
    "plate_gap": 16,  # from the valves to the muscles' upper ends
    "tendon": 26,  # least length of the cord between a muscle and its pulley
    "slim": 0.82,  # width of an empty muscle over its diameter
    "swell": 0.55,  # what a full one is wider by
    "fullest": 1.3,  # of the highest pressure of the arm; beyond it a muscle is not drawn wider
    "pale": 0.08,  # opacity of the air in an empty muscle
    "air": 0.82,  # what it is more opaque by in a full one
    "weight": 13,  # radius of the weight at the end
    "fading": 0.75,  # of a valve's light from one picture to the next: pulses of milliseconds are to be seen
}
"""Lengths [mm] and shares."""

COLOURS = {
    "paper": ("#ffffff", "#0f1418"),
    "ink": (INK, "#e7ebee"),
    "stroke": ("#2a3238", "#c9d2d8"),
    "metal": ("#8d949a", "#7d8891"),
    "rubber": ("#d4d7d9", "#3a444c"),
    "blue": (DARK, "#7fbfee"),
    "orange": (MIDDLE, "#ff9560"),
    "sand": (LIGHT, "#e3bd5d"),
}
"""On light and on dark screens."""


class Look(NamedTuple):
    """How the shapes of a kind are drawn: the names of their colours, their line's width [mm]."""

    fill: str | None = None
    stroke: str | None = None
    width: float = 0.0
    opacity: float = 1.0


LOOKS = {
    "plate": Look(None, "stroke", 5),
    "column": Look(None, "stroke", 5, 0.14),
    "ghost": Look(None, "orange", 9, 0.32),
    "past": Look(None, "blue", 5, 0.3),
    "link": Look(None, "stroke", 11),
    "bone": Look(None, "paper", 4.5),
    "pulley": Look("paper", "stroke", 2.5),
    "mark": Look(None, "stroke", 2.5),
    "weight": Look("metal", "stroke", 2.5),
    "tendon": Look(None, "stroke", 2),
    "coil": Look(None, "stroke", 2),
    "rubber": Look("rubber", "stroke", 1.5),
    "air-1": Look("blue"),
    "air-2": Look("sand"),
    "weave": Look(None, "stroke", 0.6, 0.45),
    "valve": Look("paper", "metal", 1.2),
    "open-1": Look("blue"),
    "open-2": Look("sand"),
}


@dataclass(frozen=True)
class Measures:
    """One joint: its link, its pulley, and the muscles that pull at it from the link before."""

    link: float
    """From the hinge to the next one, or to the weight at the end [m]."""
    pulley: float
    """Radius [m]."""
    muscle: float
    """Length of a muscle with the joint in the middle [m]."""
    diameter: float
    """Diameter of a muscle without pressure [m]."""


USUAL = Measures(link=0.21, pulley=0.034, muscle=0.19, diameter=0.03)
"""How an arm is drawn of which nobody knows the measures; then nothing is to scale."""


@dataclass(frozen=True)
class Pose:
    """What an arm does at a moment; or at n of them, then each has n rows."""

    degrees: Array
    """Angles of the joints, shape (joints,)."""
    full: Array
    """Pressures over the arm's highest, shape (joints, 2)."""
    lights: Array
    """How open the valves were, shape (joints, 2): above 0 inlets, below 0 outlets."""

    def __getitem__(self, k: int) -> "Pose":
        return Pose(self.degrees[k], self.full[k], self.lights[k])


class Shape(NamedTuple):
    """A shape of a kind in :data:`LOOKS`: commands of an SVG path, M and L with a point each, C with three, Z."""

    kind: str
    commands: str
    points: Array
    """Shape (n, 2)."""

    def named(self) -> tuple[str, str]:
        """Return its kind and its path."""
        return self.kind, self.path()

    def path(self) -> str:
        """Return it as the data of an SVG path."""
        numbers = iter(self.points)
        parts = []
        for command in self.commands:
            count = {"Z": 0, "C": 3}.get(command, 1)
            parts.append(command + " ".join(f"{x:.4g} {y:.4g}" for x, y in (next(numbers) for _ in range(count))))
        return "".join(parts)


def _line(kind: str, *points: tuple[float, float]) -> Shape:
    return Shape(kind, "M" + "L" * (len(points) - 1), np.array(points, np.float64))


def _closed(kind: str, *points: tuple[float, float]) -> Shape:
    open_line = _line(kind, *points)
    return open_line._replace(commands=open_line.commands + "Z")


def _circle(kind: str, y: float, r: float) -> Shape:
    k = 0.5523  # of the radius: four cubic curves are a circle
    quarter = np.array([(1, 0), (1, k), (k, 1)])
    turns = [np.linalg.matrix_power(np.array([[0, 1], [-1, 0]]), n) for n in range(4)]
    points = np.concatenate([*(quarter @ turn for turn in turns), quarter[:1]])
    return Shape(kind, "MCCCCZ", r * points + np.array([0, y]))


def _spindle(kind: str, length: float, width: float, shorter: float = 0.0) -> Shape:
    """Return a muscle from its upper end (0, 0) to (0, length): conical ends, thicker in the middle."""
    w, e, top, low = width / 2, width * 0.225, shorter, length - shorter
    end = min(w * 0.9, length * 0.2)
    left = [(-e, top), (-w, top + end * 0.4), (-w, end), (-w, end * 1.4), (-w, length - end * 1.4)]
    left += [(-w, length - end), (-w, length - end * 0.4), (-e, low)]
    return Shape(kind, "MCLCLCLCZ", np.array(left + [(-x, y) for x, y in reversed(left)]))


def _weave(length: float, width: float) -> Shape:
    w, starts = 0.4 * width, np.arange(12.0, length - 14, 9)
    strands = [point for y in starts for point in ((-w, y), (w, y + 8), (w, y), (-w, y + 8))]
    return Shape("weave", "MLML" * len(starts), np.array(strands).reshape(-1, 2))


def _coil(length: float, width: float, turns: int = 11) -> Shape:
    y = np.concatenate(
        [[0, 12], 12 + (np.arange(2 * turns) + 0.5) * (length - 24) / (2 * turns), [length - 12, length]]
    )
    x = np.concatenate([[0, 0], width / 2 * np.resize([1.0, -1.0], 2 * turns), [0, 0]])
    return Shape("coil", "M" + "L" * (len(y) - 1), np.stack([x, y], axis=1))


@dataclass(frozen=True)
class Muscle:
    """A muscle, or the spring in its place, in a frame that is the link before the joint."""

    at: tuple[float, float]
    """Its upper end."""
    rest: float
    """Its length with the joint in the middle."""
    body: tuple[Shape, ...]
    """What is stretched, from the upper end on, as it is in the middle and a full diameter wide."""
    fixed: tuple[Shape, ...] = ()
    """What is beneath the body and stays as it is."""
    lights: tuple[Shape, ...] = ()
    """Over its valves while they are open: inlet, outlet."""

    def stretch(self, degrees: Array, full: Array) -> tuple[Array, Array]:
        """Return how wide and how long the body is over what it is at rest.

        Args:
            degrees: of the joint.
            full: pressure over the arm's highest, the same shape.

        """
        length = 1 - self.at[0] * np.radians(degrees) / self.rest
        if not self.lights:
            return np.ones_like(length), length
        full = np.clip(full, 0, PROPORTIONS["fullest"])
        return PROPORTIONS["slim"] + PROPORTIONS["swell"] * full / length, length

    def for_page(self) -> dict[str, Any]:
        """Return it as JSON."""
        shapes = {name: [one.named() for one in getattr(self, name)] for name in ("body", "fixed", "lights")}
        return {"at": self.at, "rest": self.rest, **shapes}


class DrawnArm:
    """The shapes of an arm.

    Args:
        measures: of each joint.
        muscles: of each joint, 1 or 2.

    """

    def __init__(self, measures: Sequence[Measures], muscles: int = 2) -> None:
        self.links = [1000 * one.link for one in measures]
        self.muscles: list[list[Muscle]] = []
        self.turning: list[list[Shape]] = []
        """What turns with each joint."""
        for j, one in enumerate(measures):
            rest = min(1000 * one.muscle, 0.6 * self.links[j - 1] if j else np.inf)
            made = [_muscle(n + 1, one, rest) if n < muscles else _spring(one, rest) for n in range(2)]
            self.muscles.append(made)
            self.turning.append(_joint(self.links[j], 1000 * one.pulley, last=j == len(measures) - 1))
        top = self.muscles[0][0].at[1] - PROPORTIONS["plate_gap"]
        self.above, self.reach = 26 - top, sum(self.links)
        """From the first hinge to the upper end of the picture, and to the end of the arm that hangs down."""
        self.plate = [_line("plate", (-70, top - 18), (70, top - 18)), _line("column", (0, top - 18), (0, 0))]
        self.ghost = [[_line("ghost", (0, 0), (0, length))] for length in self.links]
        """The bare link of each joint."""

    @classmethod
    def of(cls, spec: ArmSpec) -> "DrawnArm":
        """Return the arm of ``spec``, to scale as far as its links are known."""
        links = spec.links or (USUAL.link,) * spec.joints
        return cls([replace(USUAL, link=link) for link in links], spec.muscles)

    def placed(self, pose: Pose) -> Iterator[tuple[Shape, float]]:
        """Yield all shapes where they are, from the lowest, and their opacity over what it always is."""
        yield from ((shape, 1.0) for shape in self.plate)
        for j, (turned, origin, still) in enumerate(self._frames(pose.degrees)):
            for shape in self.turning[j]:
                yield shape._replace(points=shape.points @ turned + origin), 1.0
            for muscle, fill, light in zip(self.muscles[j], pose.full[j], pose.lights[j], strict=True):
                stretch = np.array(muscle.stretch(pose.degrees[j], fill))
                shapes = [(shape, np.ones(2), 1.0) for shape in muscle.fixed]
                shapes += [
                    (shape, stretch, float(air(fill)) if "air" in shape.kind else 1.0) for shape in muscle.body
                ]
                shapes += [
                    (one, np.ones(2), max(s * light, 0)) for s, one in zip((1, -1), muscle.lights, strict=False)
                ]
                for shape, scale, opacity in shapes:
                    yield shape._replace(points=(shape.points * scale + muscle.at) @ still + origin), opacity

    def for_page(self, place: str) -> dict[str, Any]:
        """Return all of it as JSON, for a page that moves it itself in the SVG at the CSS selector ``place``."""
        return {
            **PROPORTIONS,
            "style": style(place),
            "above": self.above,
            "links": self.links,
            "plate": [shape.named() for shape in self.plate],
            "ghost": [[shape.named() for shape in one] for one in self.ghost],
            "turning": [[shape.named() for shape in one] for one in self.turning],
            "muscles": [[muscle.for_page() for muscle in pair] for pair in self.muscles],
        }

    def links_at(self, degrees: Array, kind: str = "ghost") -> Iterator[Shape]:
        """Yield the bare links as shapes of a ``kind``, with the joints at ``degrees`` (joints,)."""
        for (turned, origin, _), (shape,) in zip(self._frames(degrees), self.ghost, strict=True):
            yield shape._replace(kind=kind, points=shape.points @ turned + origin)

    def _frames(self, degrees: Array) -> Iterator[tuple[Array, Array, Array]]:
        """Yield of each joint how it is turned, where it is, and how the link before it is turned."""
        origin, still, angle = np.zeros(2), np.eye(2), 0.0
        for degree, link in zip(degrees, self.links, strict=True):
            angle += np.radians(degree)
            turned = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            yield turned, origin, still
            origin, still = origin + (0, link) @ turned, turned


def style(place: str, looks: Mapping[str, Look] = LOOKS) -> str:
    """Return ``looks`` as a style element for the SVG at the CSS selector ``place``, as it reaches the whole page."""
    light, dark = (
        "".join(
            f"{place} .{kind}{{fill:{COLOURS[look.fill][i] if look.fill else 'none'}"
            + (f";stroke:{COLOURS[look.stroke][i]};stroke-width:{look.width}" if look.stroke else "")
            + (f";opacity:{look.opacity}" if look.opacity < 1 else "")
            + "}"
            for kind, look in looks.items()
        )
        for i in (0, 1)
    )
    return f"<style>{light}@media screen and (prefers-color-scheme:dark){{{dark}}}</style>"


def air(full: Array) -> Array:
    """Return how opaque the air in a muscle is that is ``full`` of pressure."""
    return PROPORTIONS["pale"] + PROPORTIONS["air"] * np.clip(full, 0, 1)


def brightness(valves: Array) -> Array:
    """Return how bright the lights of ``valves`` (n, ...) are, -1 to 1 as they are, from picture to picture."""
    lights = np.sign(valves) * np.sqrt(np.abs(valves))
    for k in range(1, len(lights)):
        lights[k] = np.where(valves[k] == 0, PROPORTIONS["fading"] * lights[k - 1], lights[k])
    return lights


def _muscle(number: int, measures: Measures, rest: float) -> Muscle:
    side, radius, width = (1, -1)[number - 1], 1000 * measures.pulley, 1000 * measures.diameter
    top, up, x = rest + PROPORTIONS["tendon"] + radius * 0.8, -PROPORTIONS["plate_gap"], side * 15
    valves = [((x - 6, y), (x + 6, y), (x, y + down)) for y, down in ((up - 9, 9), (up + 13, -9))]
    return Muscle(
        (side * radius, -top),
        rest,
        body=(_spindle("rubber", rest, width), _spindle(f"air-{number}", rest, 0.86 * width, 4), _weave(rest, width)),
        fixed=(
            _line("tendon", (0, 0), (0, top)),
            _line("tendon", (0, 0), (0, up + 2), (x, up + 2)),
            *(_closed("valve", *valve) for valve in valves),
        ),
        lights=tuple(_closed(f"open-{number}", *valve) for valve in valves),
    )


def _spring(measures: Measures, rest: float) -> Muscle:
    radius = 1000 * measures.pulley
    top = rest + PROPORTIONS["tendon"] + radius * 0.8
    return Muscle((-radius, -top), top, body=(_coil(top, 700 * measures.diameter),))


def _joint(link: float, radius: float, *, last: bool) -> list[Shape]:
    shapes = [_line("link", (0, 0), (0, link)), _line("bone", (0, 0), (0, link)), _circle("pulley", 0, radius)]
    shapes += [_line("mark", (0, radius * 0.4), (0, radius)), _circle("weight", 0, 4)]
    return [*shapes, _circle("weight", link, PROPORTIONS["weight"])] if last else shapes
