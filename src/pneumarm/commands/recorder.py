"""Keeping what an arm did by name: a store that movements are added to."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from pneumarm.address import Address
from pneumarm.arm import ArmSpec
from pneumarm.transitions import Store
from pneumarm.transitions.rows import Recorded

Keep = Callable[[Recorded, Mapping[str, Any]], None]


@contextmanager
def recorder(address: Address | None, spec: ArmSpec) -> Iterator[Keep]:
    """Give what adds a movement, and what was asked for in it, to the store at ``address``; to nothing without one.

    Raises:
        UnusableInput: the store is one of another arm, or cannot be written.

    """
    if address is None:
        yield lambda recorded, info: None
        return
    with Store.for_arm(address, spec) as store:
        store.check_arm(spec)
        store.begin_run("move", {})
        yield lambda recorded, info: _add(store, recorded, info)


def _add(store: Store, recorded: Recorded, info: Mapping[str, Any]) -> None:
    store.append(replace(recorded, info=info))
