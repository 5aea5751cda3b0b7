"""What muscles of strangers pull with: five families of laws, each measured into a table over the contraction.

A law gives the force at a contraction k (a share of the length) and a pressure p [bar gauge] as

    F = A (a(k) + b(k) p + c(k) p^2),

A the muscle's area. What the pressure does besides is work, F dx = p dV, from which its volume follows:
dV / dk = A L b(k), L its length. Coefficients are drawn; the forms are those of

- fluidic: an exponential of the contraction beside a line (J. Sarosi, 2012; J. Sarosi et al., 2015).
- isobaric: a polynomial in contraction and pressure, above a pressure that only blows up the bladder
  (D. G. Caldwell, G. A. Medrano-Cerda and M. Goodwin, 1995).
- three-element: spring and damper that grow with the pressure beside what contracts (D. B. Reynolds et al., 2003).
- pleated: without bound towards no contraction (F. Daerden and D. Lefeber, 2001; B. Verrelst et al., 2006).
- pouch: flat bags of two sheets that become cylinders (R. Niiyama et al., 2015).
- bellows: push, by an area that lessens a little, against folds that are springs both ways
  (P. Polygerinos et al., 2015).
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

POINTS = 257
"""Of a table."""
BAR = 1e5  # Pa
LITRES = 1e3  # 1/m3


class Law(NamedTuple):
    """A law as drawn; pressures in bar."""

    family: str
    low: float
    """Lowest contraction that a joint may use."""
    high: float
    """Highest, at which nothing is pulled any more."""
    coefficients: Callable[[Array], tuple[Array, Array, Array]]
    """a, b and c over the contraction [bar, 1, 1/bar]."""
    start: float = 0.0
    """Pressure that only blows up the bladder."""
    pushes: bool = False
    """Whether it can push as well as pull: nothing goes slack."""
    damped: bool = False
    """Whether it has a damper that grows with the pressure."""


class Muscles(NamedTuple):
    """Muscles of an arm, two a joint, as they enter the compiled loop."""

    table: Array
    """Force at 0 bar [N], by bar [N/bar], by its square [N/bar2], and volume [l], shape (joints, 2, POINTS, 4)."""
    lowest: Array
    """Contraction at the first point, shape (joints, 2)."""
    spacing: Array
    """Contraction from point to point, shape (joints, 2)."""
    middle: Array
    """Contraction where the joint is in its middle, shape (joints, 2)."""
    length: Array
    """Shape (joints, 2) [m]."""
    start: Array
    """Shape (joints, 2) [bar]."""
    damping: Array
    """Shape (joints, 2) [N s/(m bar)]."""
    pushes: NDArray[np.bool_]
    """Shape (joints, 2)."""


def draw_law(random: np.random.Generator, full: float) -> Law:
    """Draw a law for a muscle that is filled up to ``full`` [bar]."""
    return LAWS[random.integers(len(LAWS))](random, full)


def fluidic(random: np.random.Generator, full: float) -> Law:
    steep, more, less = random.uniform(14, 28), random.uniform(0.25, 0.8), random.uniform(3.4, 4.6)
    rubber, slack = full * random.uniform(0.04, 0.15), random.uniform(0.2, 0.6)

    def coefficients(k: Array) -> tuple[Array, Array, Array]:
        fall = np.exp(-steep * k)
        return rubber * (fall - slack), more * fall + 1 - less * k, np.zeros_like(k)

    return _ending(Law("fluidic", 0.0, 0.3, coefficients), full)


def isobaric(random: np.random.Generator, full: float) -> Law:
    longest, bend, cubic = random.uniform(0.24, 0.36), random.uniform(-0.8, 0.8), random.uniform(-0.4, 0.4)
    stiffens, start = random.uniform(-0.25, 0.25) / full, full * random.uniform(0.03, 0.15)

    def coefficients(k: Array) -> tuple[Array, Array, Array]:
        share = k / longest
        pulled = (1 - share) * (1 + bend * share * (1 - share) + cubic * share**2)
        return np.zeros_like(k), pulled, stiffens * (1 - share)

    return _ending(Law("isobaric", 0.0, 1.05 * longest, coefficients, start=start), full)


def three_element(random: np.random.Generator, full: float) -> Law:
    longest, rubber, loose = random.uniform(0.22, 0.34), full * random.uniform(0.05, 0.2), random.uniform(0.0, 0.1)

    def coefficients(k: Array) -> tuple[Array, Array, Array]:
        return rubber * (loose - k) / longest, 1 - k / longest, np.zeros_like(k)

    return _ending(Law("three-element", 0.0, longest, coefficients, damped=True), full)


def pleated(random: np.random.Generator, full: float) -> Law:
    longest, steep, bend = random.uniform(0.36, 0.44), random.uniform(0.02, 0.08), random.uniform(-0.3, 0.3)

    def coefficients(k: Array) -> tuple[Array, Array, Array]:
        near = np.maximum(k, 0.02)
        share = k / longest
        return np.zeros_like(k), steep * (1 / near - 1 / longest) + (1 - share) * (1 + bend * share), np.zeros_like(k)

    return _ending(Law("pleated", 0.05, longest, coefficients), full)


def pouch(random: np.random.Generator, full: float) -> Law:
    sheet = full * random.uniform(0.0, 0.05)

    def coefficients(k: Array) -> tuple[Array, Array, Array]:
        # 1 - k = sin(t) / t, of whose series three terms are solved for t; it is pi / 2 where the bag is round.
        t = np.sqrt(10 * (1 - np.sqrt(1 - 1.2 * np.clip(k, 0.01, 0.7))))
        return -sheet * k / 0.36, np.cos(t) / t, np.zeros_like(k)

    return _ending(Law("pouch", 0.03, 0.37, coefficients), full)


def bellows(random: np.random.Generator, full: float) -> Law:
    lessens, folds, rest = random.uniform(0.1, 0.5), full * random.uniform(0.15, 0.5), random.uniform(0.1, 0.4)

    def coefficients(k: Array) -> tuple[Array, Array, Array]:
        return folds * (rest - k), 1 - lessens * k, np.zeros_like(k)

    return Law("bellows", 0.1, 0.95, coefficients, pushes=True)


LAWS = fluidic, isobaric, three_element, pleated, pouch, bellows


def _ending(law: Law, full: float) -> Law:
    """Return ``law`` with the contraction at which a muscle at ``full`` [bar] pulls no more as its highest."""
    k = np.linspace(law.low, law.high, POINTS)
    a, b, c = law.coefficients(k)
    inside = full - law.start
    pulls = a + b * inside + c * inside**2 > 0
    return law._replace(high=float(k[-1] if pulls.all() else k[int(np.argmin(pulls))]))


def measured(
    law: Law, area: float, length: float, used: tuple[float, float], dead: float
) -> tuple[Array, float, float]:
    """Return the table of a muscle, its first contraction and its spacing.

    Args:
        law: what it pulls with.
        area: [m2].
        length: [m].
        used: lowest and highest contraction that its joint uses; the table goes a little further.
        dead: volume that it has at the first contraction, as a share of what it takes up from there to the last.

    """
    beyond = 0.15 * (used[1] - used[0])
    k, spacing = np.linspace(used[0] - beyond, used[1] + beyond, POINTS, retstep=True)
    a, b, c = law.coefficients(k)
    grown = LITRES * length * area * np.maximum(b, 0.02)
    volume = np.concatenate([[0.0], np.cumsum(0.5 * spacing * (grown[1:] + grown[:-1]))])
    table = np.stack([*(BAR * area * one for one in (a, b, c)), volume + dead * volume[-1]], axis=1)
    return table, float(k[0]), float(spacing)
