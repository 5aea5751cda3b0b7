"""Settings: what help says of a default is what is used."""

from collections.abc import Iterator
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any, get_args, get_type_hints

import pytest

from pneumarm.run import RunSettings


def defaults(kind: type) -> Iterator[tuple[str, Any, Any]]:
    """Yield name, type and default of every field of the settings ``kind`` that is settings itself, and inside."""
    hints = get_type_hints(kind)
    for field in fields(kind):
        default = _default(field)
        if is_dataclass(default):
            yield f"{kind.__name__}.{field.name}", hints[field.name], default
            yield from defaults(type(default))


def _default(field: Field[Any]) -> Any:
    return field.default if field.default_factory is MISSING else field.default_factory()


@pytest.mark.parametrize(("name", "hint", "default"), list(defaults(RunSettings)))
def test_nested_defaults_are_those_of_their_type(name: str, hint: Any, default: Any) -> None:
    """Help shows the defaults of the type; an option beside it must not bring other ones back."""
    assert type(default) in (hint, *get_args(hint)), name
    assert default == type(default)(), name
