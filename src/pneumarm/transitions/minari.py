"""A store as a dataset of Minari, for offline reinforcement learning with Gymnasium's tools.

Observations and actions are those of :mod:`pneumarm.transitions.episodes`. What was recorded had no goal: rewards
are 0, no episode terminates, and every one is truncated at its end.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pneumarm.errors import UnusableInput
from pneumarm.extras import extra
from pneumarm.files import folder_written_whole
from pneumarm.transitions.episodes import action_names, episodes, observation_names
from pneumarm.transitions.store import Store

_NEEDS = "a dataset of Minari"


def export_minari(store: Store, folder: Path) -> dict[str, int]:
    """Write the rows of ``store`` into ``folder``, which is made, in bounded memory; return what was written.

    ``minari.MinariDataset(folder)`` opens it.

    Raises:
        UnusableInput: ``folder`` exists, Minari is not installed, or there is nothing to write.

    """
    extra("h5py", "minari", _NEEDS)
    spaces = extra("gymnasium.spaces", "minari", _NEEDS)
    storage_of = extra("minari.dataset.minari_storage", "minari", _NEEDS).MinariStorage
    buffer_of = extra("minari.data_collector", "minari", _NEEDS).EpisodeBuffer
    seen, done = len(observation_names(store)), len(action_names(store))
    most = 1.0 if store.valves else np.inf
    counts = {"rows": 0, "sequences": 0}

    def buffers() -> Iterator[Any]:
        for number, episode in enumerate(episodes(store)):
            n = len(episode.action)
            counts["rows"] += n
            counts["sequences"] += 1
            yield buffer_of(
                id=number,
                observations=episode.observation,
                actions=episode.action,
                rewards=np.zeros(n),
                terminations=np.zeros(n, bool),
                truncations=np.arange(n) == n - 1,
            )

    with folder_written_whole(folder) as temporary:
        storage = storage_of.new(
            temporary,
            observation_space=spaces.Box(-np.inf, np.inf, (seen,), np.float64),
            action_space=spaces.Box(-most, most, (done,), np.float64),
        )
        about = f"{store.spec.name}: observations {', '.join(observation_names(store))}; actions "
        storage.update_metadata(
            {
                "dataset_id": f"pneumarm/{_safe(folder.stem)}-v0",
                "description": about + ", ".join(action_names(store)),
                "minari_version": extra("minari", "minari", _NEEDS).__version__,
                "requirements": [],
            }
        )
        storage.update_episodes(buffers())
        if not counts["sequences"]:
            raise UnusableInput(f"{store.address}: holds nothing that could be exported")
    return counts


def _safe(name: str) -> str:
    """Return a name as it may stand in the name of a dataset."""
    return "".join(one if one.isalnum() and one.isascii() else "-" for one in name).strip("-") or "recording"
