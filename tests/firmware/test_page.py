"""The constants in C are those of the protocol's page."""

import re
import shutil
from pathlib import Path

import pytest

from children import python
from tests.firmware import wire
from tests.firmware.build import FIRMWARE

HEADER = {
    name: int(value.rstrip("UL"), 0)
    for name, value in re.findall(r"^#define (\w+) (\w+)", (FIRMWARE / "protocol.h").read_text(), re.MULTILINE)
}
LENGTHS = {
    f"{row['name']}_LENGTH": int(row["length"]) for kind in ("Requests", "Replies") for row in wire.tables()[kind]
}
ON_THE_PAGE = {
    **wire.CONSTANT,
    **wire.REQUEST,
    **wire.REPLY,
    **LENGTHS,
    **wire.CODE,
    **wire.FLAG,
    **wire.REASON,
    **wire.CAUSE,
}


def test_header_holds_the_numbers_of_the_page_and_no_others() -> None:
    assert HEADER == ON_THE_PAGE


@pytest.mark.parametrize("name", [*wire.REQUEST, *wire.REPLY])
def test_length_is_that_of_the_fields(name: str) -> None:
    assert wire.layout(name).size == LENGTHS[f"{name}_LENGTH"]


def test_no_frame_is_longer_than_the_page_says() -> None:
    longest = max(wire.layout(name).size for name in (*wire.REQUEST, *wire.REPLY))
    assert len(wire.enclosed(bytes([1] * (3 + longest)))) <= wire.CONSTANT["LONGEST_FRAME"]


def test_flags_and_types_are_different() -> None:
    for kind in (wire.FLAG, {**wire.REQUEST, **wire.REPLY}, wire.REASON, wire.CAUSE, wire.CODE):
        assert len(set(kind.values())) == len(kind)
    assert sum(wire.FLAG.values()) == max(wire.FLAG.values()) * 2 - 1  # one bit each


def test_drawing_is_the_one_of_the_page(tmp_path: Path) -> None:
    shutil.copy(FIRMWARE / "PROTOCOL.md", tmp_path)
    shutil.copy(FIRMWARE / "wiring.py", tmp_path)
    python(tmp_path / "wiring.py", check=True)
    assert (tmp_path / "wiring.svg").read_text() == (FIRMWARE / "wiring.svg").read_text()
