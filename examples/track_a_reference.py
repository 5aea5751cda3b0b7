"""Follow references: a sinusoid by its name, and a spiral of your own. Needs arm.agent from first.py."""

import math

import numpy as np

import pneumarm
from pneumarm.arm.reference import Reference

ARM = "virtual:seed=7"

print(pneumarm.track("arm.agent", ARM, "sine:0.5Hz,15deg", seconds=6))

with pneumarm.open_arm(ARM) as arm:
    middle, degree = sum(arm.spec.angle_range) / 2, arm.spec.counts_per_degree

    def growing(time: float) -> np.ndarray:
        """Return the angle that is wanted (joints,) [counts]: a sinusoid that grows from 0 to 18 degrees."""
        return np.array([middle + 3 * min(time, 6) * degree * math.sin(3 * time)])

    followed = pneumarm.track("arm.agent", arm, Reference(growing), seconds=6)
    late = np.abs(followed.degrees - followed.wanted_degrees).max()
    print(f"{followed}, at most {late:.1f} degrees off, {followed.air:.1f} litres of air")
