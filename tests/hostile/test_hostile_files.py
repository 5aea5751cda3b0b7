"""Damaged, swapped and hostile files and words against every command that reads them: each keeps the rule."""

import random
import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from soak import Attack, amount
from tests.hostile.attacks import GROUPS
from tests.hostile.commands import DRAWING, REFUSED, Case, Commands, Outcome, violations

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="commands are forked, and limited as Linux does it")

FEWEST = 1_657
"""Cases that there are at least."""
SAMPLE = 40
"""Cases that are tried with every change."""


@cache
def chosen(sound: Path) -> dict[tuple[str, str], list[Case]]:
    """Return the cases of each group, all of them or, spread over them, as many as the environment asks for."""
    cases = {group: list(make(sound)) for group, make in GROUPS.items()}
    total = sum(map(len, cases.values()))
    assert total >= FEWEST
    share = min(amount("FILES", total) / total, 1.0)
    rng = random.Random(1)
    return {group: rng.sample(found, round(share * len(found))) for group, found in cases.items()}


@pytest.fixture(scope="module")
def attack(sound: Path) -> Iterator[Attack]:
    found = Attack("commands on hostile files", sum(map(len, chosen(sound).values())))
    yield found
    found.summarise(f"{found.failed:,} broke the rule")


def none_broken(found: list[str]) -> None:
    """Fail, with the lines of :meth:`Commands.failures`, where there are some."""
    if found:
        pytest.fail(f"{len(found)} broke the rule:\n" + "\n".join(found), pytrace=False)


@pytest.mark.soak
@pytest.mark.parametrize(("kind", "damage"), GROUPS)
def test_hostile_files(kind: str, damage: str, on_files: Commands, sound: Path, attack: Attack) -> None:
    found = []
    for case in chosen(sound)[kind, damage]:
        for failure in on_files.failures(case):
            print(f"BROKEN {failure}", flush=True)
            found.append(failure)
        attack.advance()
    attack.failed += len(found)
    none_broken(found)


def test_a_sample_of_hostile_files(on_files: Commands, sound: Path) -> None:
    rng = random.Random(2)
    cases = [case for make in GROUPS.values() for case in make(sound) if case.arguments[0] not in DRAWING]
    found = [failure for case in rng.sample(cases, SAMPLE) for failure in on_files.failures(case)]
    none_broken(found)


GOOD = Outcome(code=2, seconds=1.0, cpu=1.0, memory=200.0, output="", errors="pneumarm: a.db: this is no store\n")


@pytest.mark.parametrize(
    ("change", "broken"),
    [
        ({}, []),
        ({"code": 0, "errors": "stage 1: done\n"}, ["exit 0"]),
        ({"code": -9, "errors": ""}, ["exit -9", "0 lines of error"]),
        ({"errors": ""}, ["0 lines of error"]),
        ({"errors": GOOD.errors * 2}, ["2 lines of error"]),
        ({"errors": GOOD.errors + "more\n"}, ["1 lines of error"]),
        ({"errors": "pneumarm: " + "x" * 20_000}, ["a line of 20,010 characters"]),
        ({"errors": "pneumarm: KeyError: 'x' (a bug in pneumarm: ...)"}, ["'a bug in pneumarm'"]),
        ({"errors": "RuntimeWarning: overflow\n" + GOOD.errors}, ["'RuntimeWarning:'"]),
        ({"errors": "Traceback (most recent call last)\n" + GOOD.errors}, ["'Traceback'"]),
        ({"seconds": 6.0}, ["6.0 s, 1.0 of them computing"]),
        ({"memory": 700.0}, ["700 MB"]),
    ],
)
def test_the_rule(change: dict[str, object], broken: list[str]) -> None:
    case = Case("a case", ("move", "a.agent"), codes=REFUSED)
    assert violations(case, replace(GOOD, **change)) == broken  # type: ignore[arg-type]
    if "seconds" in change:
        assert violations(case, replace(GOOD, **change), load=1.0) == []  # type: ignore[arg-type]
