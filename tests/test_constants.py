"""The benchmark of constants finds them in the source, and changes one and nothing else."""

from pathlib import Path

from benchmarks.constants import PACKAGE, Constant, compared, constants, edited, replaced

from pneumarm.learning.servo import rest


def named(name: str) -> Constant:
    return next(one for one in constants() if str(one) == name)


def test_constants_are_found_with_their_values_and_users() -> None:
    assert named("rest._INTEGRAL").value == rest._INTEGRAL
    assert not named("rest._INTEGRAL").compiled
    assert named("commands.GAIN").compiled
    assert all((PACKAGE / one.path).exists() and one.value != 0 for one in constants())


def test_one_constant_is_changed_in_the_source() -> None:
    one = named("rest._LOOK[1]")
    source = (PACKAGE / one.path).read_text()
    before, after = source.splitlines(), edited(source, one, 0.5).splitlines()
    assert [(old, new) for old, new in zip(before, after, strict=True) if old != new] == [
        (before[one.line - 1], before[one.line - 1].replace("0.4", "0.2"))
    ]


def test_a_whole_number_becomes_another_whole_number() -> None:
    three = Constant(Path("a.py"), "A", 0, 3, 1, 4, 5, compiled=False)
    assert [three.changed(factor) for factor in (0.5, 1.5)] == [1, 5]


def test_a_constant_is_replaced_for_a_while() -> None:
    before = rest._LOOK
    with replaced(named("rest._LOOK"), 1.5):
        assert (1.5 * before[0], before[1]) == rest._LOOK
    assert before == rest._LOOK


def test_worse_is_what_is_surely_worse() -> None:
    usual = {"settled": 0.9, "seconds": 0.4, "rest": 0.1, "overshoot": 0.5, "changes": 8.0, "late": 0.0, "track": 0.4}
    rows = [{**usual, "rest": 0.1 + 0.001 * n} for n in range(40)]
    assert not compared(rows, rows)[0]
    assert compared([{**row, "rest": 1.2 * row["rest"]} for row in rows], rows)[0]
    assert compared([{**row, "settled": 0.8 + 0.001 * n} for n, row in enumerate(rows)], rows)[0]
    assert not compared([{**row, "seconds": 0.3} for row in rows], rows)[0]
