"""Settings that a person chooses: every class of them says which values are valid, in one way."""

from pneumarm.errors import UnusableInput


def check(settings: object, **valid: bool) -> None:
    """Raise UnusableInput for the first field of ``settings`` that is not ``valid``."""
    for name, is_valid in valid.items():
        if not is_valid:
            kind = type(settings).__name__
            raise UnusableInput(f"{kind}: {name} cannot be {getattr(settings, name)!r}; see its documentation")
