"""Curves of a training are written for TensorBoard, each row once, while it goes on."""

import sys
from pathlib import Path

import numpy as np
import pytest

from pneumarm.errors import UnusableInput
from pneumarm.learning.tensorboard import Scalars
from pneumarm.learning.training import Progress


def told(rows: int) -> Progress:
    curves = tuple(np.arange(3.0 * rows).reshape(rows, 3) + agent for agent in range(2))
    return Progress(0, 2, rows, 0.5, ("episodes", "price", "settled"), curves)


def test_every_row_is_written_once(tmp_path: Path) -> None:
    pytest.importorskip("tensorboardX")
    from tensorboardX.proto.event_pb2 import Event

    with Scalars(tmp_path) as scalars:
        for rows in (1, 1, 4):
            scalars.write(told(rows))
    for agent in range(2):
        (file,) = (tmp_path / f"agent-{agent + 1}").iterdir()
        content, found = file.read_bytes(), []
        while content:  # a record: its length, a checksum, the event, a checksum
            length = int.from_bytes(content[:8], "little")
            event = Event.FromString(content[12 : 12 + length])
            found += [(event.step, value.tag, value.simple_value) for value in event.summary.value]
            content = content[16 + length :]
        rows = told(4).curves[agent]
        expected = [(int(row[0]), name, row[i]) for row in rows for i, name in ((1, "price"), (2, "settled"))]
        assert found == expected


def test_what_is_missing_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "tensorboardX", None)
    with pytest.raises(UnusableInput, match=r"needs tensorboardX: pip install 'pneumarm\[tensorboard\]'"):
        Scalars(tmp_path)


def test_curves_need_a_folder(tmp_path: Path) -> None:
    pytest.importorskip("tensorboardX")
    (tmp_path / "file").touch()
    with pytest.raises(UnusableInput, match="file: expected a folder for curves"):
        Scalars(tmp_path / "file")
