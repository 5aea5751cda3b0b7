"""Movements of several joints whose goals are easier at first, for learners of other libraries.

All joints have to be near their goals and slow at once, and every switch costs, so that what knows nothing yet hardly
ever reaches a goal. Our policy begins with wider tolerances and cheap switches; so do these.
"""

from dataclasses import replace
from typing import Any

from pneumarm.gym import PointToPointVector
from pneumarm.task import TaskSettings
from pneumarm.task.environment import environment

EASED = 0.5
"""Share of the steps in which goals are easier."""
WIDER, CHEAPER = 4.0, 0.2
"""Times as wide the tolerances are at first, and the share of its price that a switch then costs."""
STAGES = 50
"""In which they become what they are."""


class EasierFirst(PointToPointVector):
    """The vectorised environment; with one joint, and after :data:`EASED` of the steps, as it is."""

    def __init__(self, simulation: Any, begin: Any, *given: Any, **named: Any) -> None:
        super().__init__(simulation, begin, *given, **named)
        self._begin, self._stage = begin, STAGES
        self.ease(0.0)

    def ease(self, share: float) -> None:
        """Make goals as easy as they are after this ``share`` of the steps."""
        stage = STAGES if self.simulation.spec.joints == 1 else min(round(share / EASED * STAGES), STAGES)
        if stage == self._stage:
            return
        self._stage, left = stage, 1 - stage / STAGES
        usual = TaskSettings().reward
        wider = 1 + (WIDER - 1) * left
        reward = replace(
            usual,
            switch=usual.switch * (1 - (1 - CHEAPER) * left),
            angle_tolerance=usual.angle_tolerance * wider,
            velocity_tolerance=usual.velocity_tolerance * wider,
        )
        self._world = environment(self.simulation, self._begin, TaskSettings(reward=reward))
