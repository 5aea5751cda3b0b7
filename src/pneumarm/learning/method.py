"""What a method is that trains agents; :mod:`pneumarm.learning.methods` has a table of them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from pneumarm.learning.agents import AnyAgent
from pneumarm.learning.training import Training

TaskName = Literal["reach", "settle", "hold", "track"]


@dataclass(frozen=True)
class Method:
    """A method: what it is told, how it trains agents, and how these are read again."""

    settings: type[Any]
    """Class of its settings, a dataclass whose defaults work. They decide the task of its agents, too."""
    train: Callable[..., Training[Any]]
    """Called with simulation, begin states, settings and seed, and by their names ``progress``, ``checkpoint`` and
    ``threads``, see :func:`~pneumarm.learning.methods.train`."""
    load: Callable[[Path], AnyAgent]
    """Returns the agent in a file."""
    tasks: tuple[TaskName, ...] = ("reach",)
    """What its agents can be asked to do."""
    place: str = "own"
    """Field of :class:`~pneumarm.learning.methods.LearnSettings` that holds its settings."""
    fixed: Mapping[str, Any] = field(default_factory=dict)
    """Settings that are as they are, because they make the method."""
