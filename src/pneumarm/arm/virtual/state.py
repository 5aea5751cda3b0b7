"""The state of a virtual arm: records that the kernels change in place.

======================  ====================================================================  ==========
MUSCLE                  meaning                                                               unit
======================  ====================================================================  ==========
pressure                absolute pressure p                                                   Pa
length                  length l of the braid                                                 m
volume                  volume V(l) inside the braid                                          m3
engaged                 pressure p_eff that reaches the weave, above the threshold            Pa
engagement              s = dp_eff/dp                                                         1
tension                 pull F of the whole muscle                                            N
slip                    force z of each Maxwell-slip element                                  N
creep                   relaxed stretch xi of each branch of the Prony series                 m
creep_pull              sum of G_k xi_k                                                       N
temperature             temperature of the muscle                                             Celsius
heat                    work turned into heat since the last slow tick                        J
taken                   free air that the inlet has let in so far                             m3
leap                    what a sensor towards the valve reads too much while air flows        Pa
open                    whether the inlet and the outlet are open (0 or 1)                    1
pending                 number of switchings under way at the inlet and the outlet            1
toggles                 their times; a valve is open or closed, so a time says everything     s
bladder_stiffness ...   parameters at the muscle's temperature, named as in MuscleParameters
======================  ====================================================================  ==========

======================  ====================================================================  ==========
JOINT                   meaning                                                               unit
======================  ====================================================================  ==========
angle, speed            angle theta and its derivative                                        rad, rad/s
acceleration            its second derivative over the last substep                           rad/s2
hanging, swinging       absolute angle phi of the link and its derivative, when last used     rad, rad/s
torque                  workspace: torque about the joint, and what is made of it             N m
inertia                 workspace: row of the mass matrix                                     kg m2
======================  ====================================================================  ==========

======================  ====================================================================  ==========
SURROUNDINGS            meaning                                                               unit
======================  ====================================================================  ==========
time                    the arm's clock                                                       s
tick                    time of the last slow tick                                            s
deviation               fluctuation of the supply, an Ornstein-Uhlenbeck process              Pa
supply                  absolute pressure of the supply                                       Pa
temperature             temperature of the room                                               Celsius
sag                     fall of the supply by the air that is taken                           Pa
drawn                   free air that all inlets had let in at the last update of the sag     m3
======================  ====================================================================  ==========

Slow states (creep, heat, room, supply) change at slow ticks of the arm's own clock, so that cutting a wait
into pieces does not change them.
"""

import numpy as np

from pneumarm.arm.virtual.parameters import ELEMENTS, MOST_JOINTS

QUEUE = 8
"""Switchings that can be under way in one valve at a time."""
INLET, OUTLET = 0, 1
"""Places in ``open``, ``pending`` and ``toggles``."""
SLOW_TICK = 0.025
"""Time between two updates of the slow states [s]."""

MUSCLE = np.dtype(
    [
        ("pressure", "f8"),
        ("length", "f8"),
        ("volume", "f8"),
        ("engaged", "f8"),
        ("engagement", "f8"),
        ("tension", "f8"),
        ("slip", "f8", (ELEMENTS,)),
        ("creep", "f8", (ELEMENTS,)),
        ("creep_pull", "f8"),
        ("temperature", "f8"),
        ("heat", "f8"),
        ("taken", "f8"),
        ("leap", "f8"),
        ("open", "i8", (2,)),
        ("pending", "i8", (2,)),
        ("toggles", "f8", (2, QUEUE)),
        ("bladder_stiffness", "f8"),
        ("bladder_length", "f8"),
        ("threshold", "f8"),
        ("viscosity", "f8"),
        ("viscosity_per_pressure", "f8"),
        ("friction", "f8"),
        ("friction_per_pressure", "f8"),
    ]
)
JOINT = np.dtype(
    [
        ("angle", "f8"),
        ("speed", "f8"),
        ("acceleration", "f8"),
        ("hanging", "f8"),
        ("swinging", "f8"),
        ("torque", "f8"),
        ("inertia", "f8", (MOST_JOINTS,)),
    ]
)
SURROUNDINGS = np.dtype(
    [
        ("time", "f8"),
        ("tick", "f8"),
        ("deviation", "f8"),
        ("supply", "f8"),
        ("temperature", "f8"),
        ("sag", "f8"),
        ("drawn", "f8"),
    ]
)
