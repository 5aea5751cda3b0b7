"""The versions of an agent that adapts: each is a file, their history is told, and any can be put back.

In a folder of ``pneumarm transfer`` or ``pneumarm run``:

    agents/000.safetensors, 001...   the agent that arrived, and each version it has become
    adaptation.json                  what happened when, and how well the simulation predicted each movement
    adapted.safetensors              the version in use
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pneumarm.adaptation import Event, sentences
from pneumarm.errors import UnusableInput
from pneumarm.files import read_json, write_json
from pneumarm.learning import AnyAgent, load_agent

AGENTS, HISTORY, ADAPTED = "agents", "adaptation.json", "adapted.safetensors"
_LARGEST = 64 << 20  # bytes; a movement of several joints has some hundred
TRAINED = "agent.safetensors"
"""The agent of a run as it was trained in the simulation."""


def agents_in(folder: Path) -> list[Path]:
    """Return the agents in the folder of a run or of a transfer, the one in use first."""
    return [file for file in (folder / ADAPTED, folder / TRAINED) if file.exists()]


def agent_file(path: Path) -> Path:
    """Return the file of an agent: ``path``, or where that is a folder the agent in use there.

    Raises:
        UnusableInput: it is a folder without one.

    """
    if not path.is_dir():
        return path
    if not (found := agents_in(path)):
        raise UnusableInput(
            f"{path}: expected the folder of a run or of a transfer, or a file; there is neither {ADAPTED} nor "
            f"{TRAINED} in it"
        )
    return found[0]


@dataclass(frozen=True)
class Adapted:
    """How an agent adapted between movements, see :class:`~pneumarm.adaptation.Adaptation`."""

    version: int
    """Of the agent as it is after learning; 0 is the one that arrived."""
    quantities: list[str]
    """What its simulation predicts."""
    squares: NDArray[np.float64]
    """Mean squared error in each movement over that of the fit, shape (movements, 2, quantities): of the simulation
    that arrived, and of the one in use."""
    events: list[Event]

    @property
    def sentences(self) -> list[str]:
        """What happened, for people."""
        return sentences(self.events, self.quantities)


@dataclass(frozen=True)
class History(Adapted):
    """The same as it is in a folder."""

    put_back_by_hand: tuple[int, ...] = ()
    """Versions that a person put back, one after the other."""

    @classmethod
    def of(cls, found: Any) -> Self:
        """Return what :func:`save_history` wrote.

        Raises:
            KeyError, TypeError, ValueError: it is something else.

        """
        quantities = [str(name) for name in found["quantities"]]
        return cls(
            version=int(found["version"]),
            quantities=quantities,
            squares=np.array(found["squares"], np.float64).reshape(-1, 2, len(quantities)),
            events=[Event(**event) for event in found["events"]],
            put_back_by_hand=tuple(int(number) for number in found.get("put_back_by_hand", ())),
        )


def version_keeper(folder: Path) -> Callable[[int, AnyAgent], None]:
    """Return what writes each version that it is told of into ``folder``."""

    def keep(version: int, agent: AnyAgent) -> None:
        place = folder / AGENTS
        place.mkdir(exist_ok=True)
        agent.save(_file(folder, version))

    return keep


def _file(folder: Path, version: int) -> Path:
    return folder / AGENTS / f"{version:03d}.safetensors"


def save_history(folder: Path, adapted: Adapted | None) -> None:
    """Write ``adaptation.json``; nothing of an agent that does not adapt between movements."""
    if adapted is not None:
        write_json(folder / HISTORY, {**asdict(adapted), "squares": np.round(adapted.squares, 4).tolist()})


def read_history(folder: Path) -> History:
    """Return the history in ``folder``.

    Raises:
        UnusableInput: there is none, or it is damaged.

    """
    path = folder / HISTORY
    expected = "the history of an adaptation, as in a folder of pneumarm transfer or run whose agent adapts"
    found = read_json(path, expected, _LARGEST)
    try:
        return History.of(found)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise UnusableInput(f"{path}: expected {expected} ({error!r})") from error


def kept_versions(folder: Path) -> list[int]:
    """Return the numbers of the versions in ``folder``, in order."""
    return sorted(int(path.stem) for path in (folder / AGENTS).glob("*.safetensors") if path.stem.isdigit())


def put_back(folder: Path, version: int) -> History:
    """Make ``version`` the one in use, and return the history as it is then.

    Raises:
        UnusableInput: there is no such version, or it is damaged.

    """
    history, kept = read_history(folder), kept_versions(folder)
    if version not in kept:
        raise UnusableInput(
            f"{folder}: there is no version {version}; there are {', '.join(map(str, kept)) or 'none'}"
        )
    load_agent(_file(folder, version)).save(folder / ADAPTED)
    history = replace(history, version=version, put_back_by_hand=(*history.put_back_by_hand, version))
    save_history(folder, history)
    return history
