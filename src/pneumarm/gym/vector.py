"""Thousands of movements in a simulation at once, in one compiled step on several threads."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from reprlib import repr as shortened
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.valves import ACTIONS
from pneumarm.errors import UnusableInput
from pneumarm.gym.batch import begin_batch, outcome, simulated_arms, step_batch
from pneumarm.gym.options import known_options
from pneumarm.gym.simulated import Copied, simulated_space
from pneumarm.gym.spaces import action_space, numbered
from pneumarm.random import random_state
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.task.environment import environment
from pneumarm.task.settings import TaskSettings

Array = NDArray[Any]

_FEWEST = 256  # movements that are worth a thread of their own


class PointToPointVector(Copied, VectorEnv[Array, Array, Array]):
    """The task of :func:`pneumarm.gym.point_to_point` many times over in a simulation.

    Movement ``e`` of ``reset(seed=s)`` is the movement of a single environment with the seed ``s + e``, whatever the
    number of threads.
    """

    _remade = "_pool"

    def __init__(
        self,
        simulation: Simulation,
        begin: BeginStates,
        num_envs: int,
        settings: TaskSettings = TaskSettings(),
        *,
        threads: int | None = None,
        autoreset_mode: AutoresetMode = AutoresetMode.NEXT_STEP,
        copy: bool = True,
    ) -> None:
        """Move ``num_envs`` times in ``simulation`` from ``begin`` states.

        Args:
            simulation: the simulated arm.
            begin: states to begin at.
            num_envs: number of movements at a time.
            settings: what is asked of a movement.
            threads: threads to step on; by default the cores of the machine.
            autoreset_mode: whether a new movement begins in the step that ends one (``final_obs`` in the info is then
                what ended it) or in the next step, whose action is ignored.
            copy: whether each step returns arrays of its own; without, they are overwritten by the next step.

        Raises:
            UnusableInput: fewer than one movement or thread, or a mode without automatic resets.

        """
        if num_envs < 1 or (threads is not None and threads < 1):
            raise UnusableInput(f"at least 1 movement and 1 thread are needed, got {num_envs} and {threads}")
        if autoreset_mode not in (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP):
            raise UnusableInput(f"autoreset_mode must be NEXT_STEP or SAME_STEP, got {autoreset_mode}")
        self.simulation = simulation
        self.num_envs = num_envs
        self.metadata = {"render_modes": [], "autoreset_mode": autoreset_mode}
        window = simulation.window
        self.single_action_space = action_space(simulation.spec)
        self._numbered = numbered(simulation.spec)
        self.single_observation_space = simulated_space(simulation, begin)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._same_step = autoreset_mode == AutoresetMode.SAME_STEP
        self._copy = copy
        most = os.cpu_count() or 1 if threads is None else threads
        self._threads = max(1, min(most, num_envs // _FEWEST))
        self._edges = np.linspace(0, num_envs, self._threads + 1).astype(int).tolist()
        self._remake()
        self._world = environment(simulation, begin, settings)
        self._many = simulated_arms(self._world, num_envs, self._threads)
        self._result = outcome(num_envs, window.state_size + window.joints)
        self._seeded = False

    def _remake(self) -> None:
        self._pool = ThreadPoolExecutor(self._threads - 1) if self._threads > 1 else None

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin all movements, or with ``options={"reset_mask": (num_envs,) of bool}`` some of them."""
        chosen = np.asarray(known_options(options, "reset_mask").get("reset_mask", np.ones(self.num_envs, bool)))
        if chosen.shape != (self.num_envs,) or chosen.dtype != bool:
            raise UnusableInput(f"reset_mask needs {self.num_envs} times True or False, got {shortened(chosen)}")
        seeds: Sequence[int | None] = [None] * self.num_envs
        if isinstance(seed, int | np.integer):
            seeds = [int(seed) + e for e in range(self.num_envs)]
        elif seed is not None:
            seeds = list(seed)
        elif not self._seeded:
            seeds = np.random.default_rng().integers(2**63, size=self.num_envs).tolist()
        if len(seeds) != self.num_envs:
            raise UnusableInput(f"expected a seed or {self.num_envs} of them, got {len(seeds)}")
        for e in np.flatnonzero(chosen).tolist():
            own = seeds[e]
            if own is not None:
                self._many.random[e] = random_state(own)
        self._seeded = True
        self._split(lambda t, a, b: begin_batch(self._world, self._many, a, b, t, chosen, self._result.observation))
        return self._given(self._result.observation), {}

    def step(self, actions: ArrayLike) -> tuple[Array, Array, Array, Array, dict[str, Any]]:
        """Take ``actions`` (num_envs,), or (num_envs, joints) with several joints."""
        taken = np.ascontiguousarray(actions, np.int64).reshape(self._many.actions.shape)
        count = len(self._numbered)
        if taken.min() < 0 or taken.max() >= count:
            raise UnusableInput(f"actions must be 0 to {count - 1}, got {taken.min()} to {taken.max()}")
        if count < ACTIONS:
            taken = self._numbered[taken]
        if not self._seeded:
            raise UnusableInput("call reset() before step()")
        result = self._result
        self._split(lambda t, a, b: step_batch(self._world, self._many, a, b, t, taken, self._same_step, result))
        infos: dict[str, Any] = {}
        ended = result.terminated | result.truncated
        if ended.any():
            infos = {"is_success": self._given(result.terminated), "_is_success": ended}
            if self._same_step:
                infos |= {"final_obs": self._given(result.final), "_final_obs": ended}
        observed, reward = self._given(result.observation), self._given(result.reward)
        return observed, reward, self._given(result.terminated), self._given(result.truncated), infos

    def _given(self, array: Array) -> Array:
        return array.copy() if self._copy else array

    def _split(self, job: Callable[[int, int, int], None]) -> None:
        """Do ``job(thread, first, last)`` for all parts of the batch; the first one in this thread."""
        parts = [(t, self._edges[t], self._edges[t + 1]) for t in range(self._threads)]
        others = [self._pool.submit(job, *part) for part in parts[1:]] if self._pool else []
        job(*parts[0])
        for other in others:
            other.result()

    def close_extras(self, **kwargs: Any) -> None:
        """Let the threads go."""
        if self._pool is not None:
            self._pool.shutdown()
