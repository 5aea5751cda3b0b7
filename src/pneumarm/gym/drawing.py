"""Pictures of an environment: the arm, and behind it where it is wanted."""

from collections.abc import Callable
from typing import Any, SupportsFloat

import gymnasium
import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.errors import UnusableInput

Counts = NDArray[np.float64]
Pose = Callable[[NDArray[np.float32]], tuple[Counts, Counts, Counts]]
"""Returns from an observation the angles, where they are wanted, both (joints,), and the pressures (joints, 2)."""
MODES = ["rgb_array"]
"""What can be rendered; Gymnasium makes a window ("human") and lists of pictures of it by itself."""
_INCHES, _DOTS = 4.0, 100


class Drawing(gymnasium.Wrapper[Any, Any, Any, Any]):
    """An environment with ``render_mode="rgb_array"``.

    Args:
        env: what is shown; it is not changed.
        pose: where its arm is and is to be.
        spec: of its arm.

    """

    metadata = {"render_modes": MODES, "render_fps": 30}  # noqa: RUF012 - as Gymnasium wants it

    def __init__(self, env: gymnasium.Env[Any, Any], pose: Pose, spec: ArmSpec) -> None:
        super().__init__(env)
        env.unwrapped.render_mode = MODES[0]
        self._pose, self._spec = pose, spec
        self._seen: NDArray[np.float32] | None = None
        self._figure: _Figure | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode."""
        self._seen, info = self.env.reset(seed=seed, options=options)
        return self._seen, info

    def step(self, action: Any) -> tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]:
        """Take a step."""
        self._seen, reward, terminated, truncated, info = self.env.step(action)
        return self._seen, reward, terminated, truncated, info

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_figure": None}  # a copy draws its own

    def render(self) -> NDArray[np.uint8]:
        """Return a picture, shape (height, width, 3)."""
        if self._seen is None:
            raise UnusableInput("call reset() before render()")
        self._figure = self._figure or _Figure(self._spec)
        return self._figure.draw(*self._pose(self._seen))


def renderable(env: gymnasium.Env[Any, Any], pose: Pose, spec: ArmSpec, mode: str | None) -> gymnasium.Env[Any, Any]:
    """Return ``env``, which can be rendered if a ``mode`` is asked for.

    Raises:
        UnusableInput: there is no such mode.

    """
    if mode is None:
        return env
    if mode not in MODES:
        raise UnusableInput(f"render_mode={mode!r}: expected one of human, {', '.join(MODES)}")
    return Drawing(env, pose, spec)


class _Figure:
    """The picture, of which only what moves is drawn anew."""

    def __init__(self, spec: ArmSpec) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        from pneumarm.drawing.arm_picture import ArmPicture
        from pneumarm.drawing.colours import INK
        from pneumarm.drawing.drawn_arm import DrawnArm

        self._spec, arm = spec, DrawnArm.of(spec)
        figure = Figure(figsize=(_INCHES, _INCHES), dpi=_DOTS)
        self._canvas = FigureCanvasAgg(figure)
        axes = figure.add_axes((0.0, 0.09, 1.0, 0.91))
        self._arm = ArmPicture(axes, arm, arm.reach + 20, arm.reach + 20)
        self._words = figure.text(0.5, 0.03, "", ha="center", color=INK, fontsize=12)

    def draw(self, angle: Counts, wanted: Counts, pressure: Counts) -> NDArray[np.uint8]:
        from pneumarm.drawing.drawn_arm import Pose

        degrees, goal = self._spec.degrees(angle), self._spec.degrees(wanted)
        full = self._spec.bar(pressure) / self._spec.max_pressure
        self._arm.show(Pose(degrees, full, np.zeros_like(full)), goal)
        self._words.set_text(f"{_listed(degrees)}°, wanted {_listed(goal)}°")
        self._canvas.draw()
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()


def _listed(values: Counts) -> str:
    return ", ".join(f"{value:.1f}" for value in values)
