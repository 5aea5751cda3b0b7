"""How hard does the coupling of joints make the task (section 6.1)?

The thesis built its arm so that the joints disturb each other as much as possible. Factor: the share of that
coupling, by inertia, weight and cables, of a virtual arm, from none to all of it. A simulation is fitted to each of
these arms; the thesis' agents learn one goal in it, that in the middle, a policy all of them, and move that arm. With
any other arm there is nothing to turn down.

    pneumarm experiment coupling --out laboratory
"""

from pneumarm.experiments.coupling.couplings import coupling

EXPERIMENT = coupling(0.0, 0.5, 1.0)
