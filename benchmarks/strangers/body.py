"""What joints of strangers are made of, besides muscles and memory, as it enters the compiled loop."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Body(NamedTuple):
    """Hinges of an arm; arrays (joints,), joint 1 the one that carries the other."""

    lever: Array
    """Radius of its pulley, or of its crank in the middle [m]."""
    crank: Array
    """0: a pulley. 1: a crank whose lever lessens with the cosine of the angle. Between: a cam."""
    inertia: Array
    """With the others in their middle [kg m2]."""
    viscous: Array
    """[N m s/rad]."""
    spring: Array
    """[N m/rad]."""
    rest: Array
    """Angle at which the spring is loose [rad]."""
    weight: Array
    """What gravity turns with at most [N m]."""
    upright: Array
    """Angle from hanging down to the link in the middle [rad]; of link 2, where link 1 is in its middle."""
    stop: Array
    """Angle of the end stops either side [rad]."""
    stop_stiffness: Array
    """[N m/rad]."""
    stop_damping: Array
    """[N m s/rad]."""
    creep: Array
    """Stiffness that relaxes (C. Zener's standard linear solid, 1948) [N m/rad]."""
    creep_time: Array
    """Time constant in which it does [s]."""
    carried: Array
    """Mass of link 2 times the length of link 1 times where its centre is [kg m2]; 0 for a hinge alone."""
    bend: Array
    """Angle between the links in the middle, 0 straight [rad]."""
