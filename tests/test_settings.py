"""Settings: what help says of a default is what is used."""

import math
from collections.abc import Iterator
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from typing import Annotated, Any, Literal, get_args, get_type_hints

import msgspec
import numpy as np
import pytest
from msgspec import Meta

from pneumarm.arm import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.run import RunSettings
from pneumarm.settings import Layers, PositiveFloat, PositiveInt, Settings, Share, Valid, in_words


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
    share: Share = 0.5
    least: float = 0.0

    def _valid(self) -> Valid:
        return {"least": self.least <= self.share or "at most share"}


@dataclass(frozen=True)
class Child(Parent):
    count: PositiveInt = 1
    largest: float = 1.0
    length: Annotated[float, Meta(gt=0, lt=10)] | None = None
    hidden: Layers = (4,)
    ends: tuple[float, PositiveFloat] = (0.0, 1.0)
    kind: Literal["straight", "bent", "round"] = "straight"
    flag: bool = False

    def _valid(self) -> Valid:
        return {"largest": self.largest >= self.count}


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("share", 2, "a number, 1 or less"),
        ("share", math.nan, "a number, 0 or more"),
        ("least", -math.inf, "finite numbers"),
        ("least", math.nan, "finite numbers"),
        ("least", "none", "a number"),
        ("count", 0, "a whole number, 1 or more"),
        ("count", 1.5, "a whole number"),
        ("count", True, "a whole number"),
        ("length", 0, "a number, more than 0"),
        ("length", 10, "a number, less than 10"),
        ("hidden", (), "1 or more values"),
        ("hidden", (5, 1025), "a whole number, 1024 or less, as value 2"),
        ("hidden", 5, "a list of values"),
        ("ends", (1.0, 0.0), "a number, more than 0, as value 2"),
        ("ends", (math.inf, 1.0), "finite numbers"),
        ("ends", (1.0,), "2 values"),
        ("kind", "square", "straight, bent, round"),
        ("flag", 1, "true or false"),
    ],
)
def test_what_a_type_does_not_allow_is_refused_in_python_and_in_files(name: str, value: Any, expected: str) -> None:
    with pytest.raises(UnusableInput, match=rf"Child: {name} cannot be .*; expected {expected}$"):
        Child(**{name: value})
    with pytest.raises((UnusableInput, msgspec.ValidationError), match=name):
        msgspec.convert({name: value}, Child)


def test_what_a_type_allows_is_taken() -> None:
    taken = Child(share=1, count=3, largest=3, length=9.9, hidden=(1, 1024), ends=(-1, 2), kind="round", flag=True)
    assert msgspec.convert(msgspec.to_builtins(taken), Child) == taken
    assert Child(length=None) == Child()


def test_what_a_parent_demands_is_demanded_of_its_children() -> None:
    with pytest.raises(UnusableInput, match=r"Child: share cannot be 2; expected a number, 1 or less"):
        Child(share=2)
    with pytest.raises(UnusableInput, match=r"Child: least cannot be 0\.6; expected at most share"):
        Child(least=0.6)
    with pytest.raises(UnusableInput, match=r"Child: largest cannot be 1\.0; see its documentation"):
        Child(count=2)
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


def test_the_values_that_a_field_lists_are_named() -> None:
    with pytest.raises(msgspec.ValidationError) as refused:
        msgspec.convert({"kind": "square"}, Child)
    assert in_words(refused.value, Child) == "straight, bent, round, at kind"
