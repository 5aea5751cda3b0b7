"""What several joints could do together from where they are, and which of it is best.

A policy that decides joint by joint sees neither that an action of all joints, held for ten periods, brings all of
them to their goals at the same time, nor that what it does already would: each switch costs as much as eight actions
(thesis section 5.4.1). So several joints do what the best plan says that a search in the simulation finds, every
turn anew.

Where no plan is found, or once a movement is to cost a switch more than was planned at first, so that the simulation
is wrong there, what the policy would do is compared with other *courses*: the plan, the course that was taken last,
and going on as before for some periods more. Each is followed in many copies of the simulated arm with the noise of
the simulation, and after its end the policy goes on greedily. What has the highest mean return is done, for one
period; then all is compared again. So each stands in for the other: plans need fewer switches, and hold on for long
to what does not come true.
"""

import math

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.valves import ACTIONS, possible_actions, to_actions
from pneumarm.kernels import inner, kernel
from pneumarm.learning.policy.acting import Lanes, Mind, best_of, copy_all, judge_all
from pneumarm.learning.policy.proximal import FORBIDDEN
from pneumarm.learning.policy.settings import PolicySettings
from pneumarm.planning.planner import SimulationModel
from pneumarm.planning.search import PlanSettings, find, halved, problem, tree
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.fleet import gained_by, take_alive
from pneumarm.task.reward import Reward

_POLICY = -1  # in a course: what the policy says
_HELD = 1 / 30, 0.1, 0.2, 0.4  # s for which the last actions may go on
_MOST = 3 + len(_HELD)  # courses: that of the policy, the plan, the last one, and these
_MOST_ACTIONS = 1_000  # of the whole arm, among which a plan can be sought in time


def missed(reward: Reward) -> float:
    """Return what it costs to miss the goal at the end of a plan: two switches, and eight actions to come back."""
    return max(0.0, -2 * reward.switch - 8 * reward.action)


def behind(reward: Reward) -> float:
    """Return how much more than planned a movement may cost while plans are followed: a switch, or eight actions."""
    return max(-reward.switch, -8 * reward.action)


class Courses:
    """Plans and compares what several joints could do in a movement; for one, looking ahead at actions is enough."""

    def __init__(self, simulation: Simulation, settings: PolicySettings) -> None:
        joints = simulation.window.joints
        actions = int(possible_actions(simulation.spec.muscles).sum()) ** joints
        self._search = _Search(simulation, settings) if actions <= _MOST_ACTIONS else None
        self._held = [max(round(seconds / simulation.spec.period), 1) for seconds in _HELD]
        self._horizon, self._patience, self._reward = settings.horizon, settings.patience, settings.reward
        self._courses = np.empty((_MOST, self._horizon, joints), np.int64)
        self._plan = self._last = self._courses[0, :0]
        self._spent, self._planned, self._comes_true = 0.0, math.inf, True

    def begin(self, goal: NDArray[np.float64]) -> None:
        """Begin a movement to ``goal`` (joints,) [counts]."""
        if self._search is not None:
            self._search.goal[:] = goal
        self._last = self._last[:0]
        self._spent, self._planned, self._comes_true = 0.0, math.inf, True

    def hurry(self) -> None:
        """Seek plans for about half as long from now on."""
        if self._search is not None:
            self._search.hurry()

    def plan(self, mind: Mind, single: Lanes) -> bool:
        """Seek a plan; return whether it is to be followed, and then let ``single.actions`` (1, joints) do so.

        Where the same actions have changed nothing at any joint, a plan begins with others: there the arm sticks,
        while the simulation may drift on.
        """
        if self._search is None:
            return False
        before = single.fleet.actions[0]
        sticks = self._patience > 0 and bool((single.fleet.still[0] >= self._patience).all())
        state = single.fleet.x[: mind.inputs.layout.command, 0]
        begins = before[0] < 0
        if not begins:
            self._spent -= self._reward.action + self._reward.switch * int(single.fleet.switched[0].sum())
        self._plan, cost = self._search.plan(state, before, may_hold=not begins and not sticks)
        if math.isinf(cost):
            return False
        if math.isinf(self._planned):
            self._planned = self._spent + cost
        self._comes_true = self._comes_true and self._spent + cost <= self._planned + behind(self._reward)
        if not self._comes_true:
            return False
        single.actions[0] = self._plan[0]
        self._last = self._plan[1 : self._horizon]
        return True

    def improve(self, mind: Mind, single: Lanes, lanes: Lanes, samples: NDArray[np.int64]) -> None:
        """Set ``single.actions`` (1, joints), which are what the policy would do, to what is best.

        What the policy may not do, no course begins with: where the arm sticks the simulation may drift on.
        """
        before, courses = single.fleet.actions[0], self._courses
        allowed = single.bias[:, 0].reshape(len(before), ACTIONS) > FORBIDDEN
        joints = np.arange(len(before))
        courses[...] = _POLICY
        courses[0, :1] = single.actions
        count = 1
        for course in (self._last, self._plan[: self._horizon]):
            if len(course) and allowed[joints, course[0]].all():
                courses[count, : len(course)] = course
                count += 1
        if before[0] >= 0 and allowed[joints, before].all():
            for periods in self._held:
                courses[count, : min(periods, self._horizon)] = before
                count += 1
        best = courses[compare(mind, single, lanes, samples, courses[:count], self._horizon)]
        single.actions[0] = best[0]
        self._last = best[1:][best[1:, 0] != _POLICY].copy()


class _Search:
    """Seeks plans in the simulation, by the states that an actor sees."""

    def __init__(self, simulation: Simulation, settings: PolicySettings) -> None:
        joints = simulation.window.joints
        plan = PlanSettings(nodes=settings.nodes, failure_cost=missed(settings.reward))
        self._model = SimulationModel(simulation, plan)
        reward, muscles = settings.reward.on(simulation.spec), simulation.spec.muscles
        uncertainty = self._model.uncertainty
        # Three joints have so many actions that most surer searches end for want of room.
        agility = self._model.agility if joints == 2 else self._model.hasty
        self._problem = problem(np.zeros(joints), reward, plan, uncertainty, muscles, agility)
        self.goal = self._problem.goal
        """Shape (joints,) [counts]."""
        self._tree = tree(plan, joints)
        self._actions = to_actions(self._problem.commands)
        """Actions of each joint by those of the whole arm, shape (9**joints, joints)."""

    def plan(
        self, state: NDArray[np.float32], before: NDArray[np.int64], may_hold: bool
    ) -> tuple[NDArray[np.int64], float]:
        """Return the actions (n, joints) of the best plan from the scaled ``state``, and what it costs.

        It comes after the actions ``before``, and unless it ``may_hold`` it begins with others than these. Its cost
        is infinite where none reaches the goal.
        """
        self._model.put(state)
        same = np.flatnonzero((self._actions == before).all(axis=1))
        last = int(same[0]) if same.size else -1  # none before the first
        found = find(self._model.world, self._model.states, self._problem, self._tree, last, may_hold)
        return self._actions[found.actions], found.cost

    def hurry(self) -> None:
        """Keep half as many states from now on."""
        self._tree = halved(self._tree, len(self._problem.commands))


@kernel
def compare(mind, single, lanes, samples, courses, horizon):  # type: ignore[no-untyped-def]
    """Return which of the ``courses`` (m, steps, joints) from the arm of ``single`` has the highest mean return."""
    n, count = lanes.total.shape[0], courses.shape[0]
    for e in range(n):
        samples[e] = e // count  # equal noise for all courses
    copy_all(mind, lanes, single.fleet, samples)
    follow_all(mind, lanes, courses, horizon)
    return best_of(lanes.total, count)


@inner
def follow_all(mind, lanes, courses, horizon):  # type: ignore[no-untyped-def]
    """Let lane ``e`` follow course ``e % m`` of (m, steps, joints), then the policy; sum up ``lanes.total``."""
    steps, left = courses.shape[1], lanes.total.shape[0]
    for k in range(horizon):
        judge_all(mind, lanes)
        for e in range(lanes.total.shape[0]):
            course = e % courses.shape[0]
            if k < steps and courses[course, k, 0] >= 0:
                for joint in range(lanes.actions.shape[1]):
                    lanes.actions[e, joint] = courses[course, k, joint]
        take_alive(mind.environment, mind.limits, lanes.fleet, lanes.actions, lanes.alive, lanes.is_reached)
        for e in range(lanes.total.shape[0]):
            if lanes.alive[e]:
                lanes.total[e] += gained_by(mind.environment.task, lanes.fleet, e, lanes.is_reached[e])
                if lanes.is_reached[e]:
                    lanes.alive[e] = False
                    left -= 1
        if left == 0:
            break
