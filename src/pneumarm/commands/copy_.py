"""``pneumarm copy``."""

from dataclasses import asdict

from pneumarm.commands.common import AnyStore, Json
from pneumarm.console import show, table
from pneumarm.progress import progress
from pneumarm.transitions.copying import copy_store


def copy_(source: AnyStore, target: AnyStore, /, *, json: Json = False) -> None:
    """Copy a store, with all that is known of it, to another place: from a file to a server, or back.

    All of it is there in the end, or nothing. The store may be written to meanwhile; it is copied as it was in the
    beginning.

    Parameters
    ----------
    source
        The store: a file, or postgresql://user@host/database or mysql://user@host/database.
    target
        Where to copy it to: a file that is not there, or an empty database.
    """
    with progress("copying"):
        copied = asdict(copy_store(source, target))
    show(copied, json, lambda: [table(("copied", ""), list(copied.items()))])
