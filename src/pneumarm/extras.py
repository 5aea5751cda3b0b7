"""Libraries that only some need: imported when they are used, and an error that says how to get them."""

import importlib
from typing import Any

from pneumarm.errors import UnusableInput


def extra(module: str, extra: str, what: str) -> Any:
    """Return the ``module``, which comes with the ``extra`` of that name and which ``what`` needs.

    Raises:
        UnusableInput: it is not installed.

    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        library = module.partition(".")[0]
        raise UnusableInput(f"{what} needs {library}: pip install 'pneumarm[{extra}]'") from error
