"""Settings: what help says of a default is what is used."""

from collections.abc import Iterator
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from typing import Any, get_args, get_type_hints

import numpy as np
import pytest

from pneumarm.arm import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.run import RunSettings
from pneumarm.settings import Settings, Valid


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


@dataclass(frozen=True)
class Parent(Settings):
    share: float = 0.5

    def _valid(self) -> Valid:
        return {"share": 0 <= self.share <= 1 or "0 to 1"}


@dataclass(frozen=True)
class Child(Parent):
    count: int = 1

    def _valid(self) -> Valid:
        return {"count": self.count >= 1}


def test_what_a_parent_demands_is_demanded_of_its_children() -> None:
    with pytest.raises(UnusableInput, match="Child: share cannot be 2; expected 0 to 1"):
        Child(share=2)
    with pytest.raises(UnusableInput, match="Child: count cannot be 0; see its documentation"):
        Child(count=0)
    with pytest.raises(UnusableInput, match="method 'nonsense'"):
        RunSettings(method="nonsense")
    with pytest.raises(UnusableInput, match="task cannot be 'track'; expected reach, what sarsa"):
        RunSettings(method="sarsa", task="track")


def test_lists_and_numbers_of_numpy_become_tuples_and_plain_numbers() -> None:
    spec = ArmSpec(
        joints=np.int64(1),  # type: ignore[arg-type]
        period=np.float32(0.0625),  # type: ignore[arg-type]
        counts_per_degree=np.radians(1.0),
        angle_range=[0, np.pi],  # type: ignore[arg-type]
        fill_times=np.array([1.0, 0.5]),  # type: ignore[arg-type]
    )
    assert spec == ArmSpec(1, 0.0625, float(np.radians(1.0)), angle_range=(0, np.pi), fill_times=(1.0, 0.5))
    assert [type(one) for one in (spec.joints, spec.period, spec.angle_range, spec.fill_times[1])] == [
        int,
        float,
        tuple,
        float,
    ]
    with pytest.raises(UnusableInput, match="angle_range cannot be"):
        ArmSpec(angle_range=np.array([1.0, 0.0]))  # type: ignore[arg-type]


def test_no_class_of_settings_can_forget_its_parent() -> None:
    with pytest.raises(TypeError, match="_valid"):

        class Forgetful(Parent):
            def __post_init__(self) -> None:
                pass
