"""Files are written whole or not at all, and what is read is checked before it is believed."""

import errno
import json
import os
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneumarm.errors import ArmFailure, PneumarmError, UnusableInput
from pneumarm.files import (
    folder_written_whole,
    read_arrays,
    write_arrays,
    write_json,
    write_text,
    written_whole,
)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "it.safetensors"


ARRAYS = {
    "a": np.arange(6.0).reshape(2, 3),
    "b": np.array([1, -2], np.int64),
    "c": np.zeros((0, 4), np.float32),
    "d": np.array([True, False]),
    "e": np.arange(6.0).reshape(2, 3).T,  # not contiguous
}


def test_arrays_and_settings_come_back(path):
    given = {"name": "x", "sizes": [1, 2], "nothing": None, "share": 0.1}
    write_arrays(path, "test", given, ARRAYS)
    back, arrays = read_arrays(path, "test")
    assert back == given
    assert arrays.keys() == ARRAYS.keys()
    for name, array in ARRAYS.items():
        np.testing.assert_array_equal(arrays[name], array)
        assert arrays[name].dtype == array.dtype


@pytest.mark.parametrize(("number", "code"), [(errno.ENOSPC, 1), (errno.EIO, 1), (errno.EACCES, 2)])
def test_a_full_disk_is_not_the_fault_of_what_was_asked_for(tmp_path, number, code):
    for writing in (written_whole, folder_written_whole):
        with pytest.raises(PneumarmError, match="there: cannot be written") as failure, writing(tmp_path / "there"):
            raise OSError(number, os.strerror(number))
        assert failure.value.exit_code == code
        assert ("free some space" in str(failure.value)) is (code == 1)
    assert not list(tmp_path.iterdir())


def test_another_kind_is_refused(path):
    write_arrays(path, "agent", {}, ARRAYS)
    with pytest.raises(UnusableInput, match="kind 'simulation' written by pneumarm, its kind is 'agent'"):
        read_arrays(path, "simulation")


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_not_finite_are_refused_both_ways(path, value):
    write_arrays(path, "test", {}, {"weights": np.array([1.0, value])})
    with pytest.raises(UnusableInput, match="weights holds numbers that are not finite"):
        read_arrays(path, "test")
    with pytest.raises(ValueError, match="JSON"):
        write_arrays(path, "test", {"x": value}, {})
    with pytest.raises(ValueError, match="JSON"):
        write_json(path, {"x": value})


def file_of(header, data=b"", length=None):
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return struct.pack("<Q", len(text) if length is None else length) + text + data


METADATA = {"__metadata__": {"kind": "test", "settings": "{}"}}
HOSTILE = {
    "empty": b"",
    "short": b"\x08",
    "pickle": b"\x80\x04cos\nsystem\n(S'true'\ntR.",
    "archive": b"PK\x03\x04" + bytes(100),
    "huge header": file_of(METADATA, length=1 << 62),
    "long header": file_of(METADATA, length=1 << 30),
    "no JSON": file_of(b"{nothing}"),
    "no metadata": file_of({}),
    "settings missing": file_of({"__metadata__": {"kind": "test"}}),
    "settings no JSON": file_of({"__metadata__": {"kind": "test", "settings": "{"}}),
    "settings NaN": file_of({"__metadata__": {"kind": "test", "settings": "[NaN]"}}),
    "settings deep": file_of({"__metadata__": {"kind": "test", "settings": "[" * 100_000}}),
    "huge array": file_of({**METADATA, "a": {"dtype": "F64", "shape": [1 << 40], "data_offsets": [0, 1 << 43]}}),
    "overflowing": file_of({**METADATA, "a": {"dtype": "F64", "shape": [1 << 62, 4], "data_offsets": [0, 0]}}),
    "too little data": file_of({**METADATA, "a": {"dtype": "F64", "shape": [2], "data_offsets": [0, 16]}}, bytes(8)),
    "too much data": file_of({**METADATA, "a": {"dtype": "F64", "shape": [1], "data_offsets": [0, 8]}}, bytes(80)),
    "overlapping": file_of(
        {
            **METADATA,
            "a": {"dtype": "F64", "shape": [1], "data_offsets": [0, 8]},
            "b": {"dtype": "F64", "shape": [1], "data_offsets": [0, 8]},
        },
        bytes(8),
    ),
    "unknown type": file_of({**METADATA, "a": {"dtype": "O", "shape": [1], "data_offsets": [0, 8]}}, bytes(8)),
    "brain floats": file_of({**METADATA, "a": {"dtype": "BF16", "shape": [1], "data_offsets": [0, 2]}}, bytes(2)),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_are_refused_at_once_by_name(path, name):
    path.write_bytes(HOSTILE[name])
    with pytest.raises(UnusableInput) as failure:
        read_arrays(path, "test")
    assert str(path) in str(failure.value)


def test_things_that_are_no_files_are_refused_at_once(path, tmp_path):
    for make in (lambda: None, path.mkdir, lambda: (path.rmdir(), os.mkfifo(path))):
        make()
        with pytest.raises(UnusableInput, match=path.name):
            read_arrays(path, "test")
    path.unlink()
    with open(path, "wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(UnusableInput, match="something else"):
        read_arrays(path, "test")


@given(st.integers(0, 10**6), st.binary(min_size=1, max_size=20))
@settings(max_examples=150)
def test_garbled_files_are_refused_or_read_and_never_crash(tmp_path_factory, place, garbage):
    path = tmp_path_factory.mktemp("garbled") / "it"
    write_arrays(path, "test", {"x": 1}, ARRAYS)
    data = bytearray(path.read_bytes())
    place %= len(data)
    data[place : place + len(garbage)] = garbage
    path.write_bytes(data)
    try:
        _, arrays = read_arrays(path, "test")
    except UnusableInput:
        return
    assert all(np.isfinite(array).all() for array in arrays.values())


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path):
    path = tmp_path / "it.txt"
    write_text(path, "before")

    def fail_halfway():
        with written_whole(path) as temporary:
            temporary.write_text("half of wh")
            assert path.read_text() == "before"
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail_halfway()
    assert path.read_text() == "before"
    assert [p.name for p in tmp_path.iterdir()] == ["it.txt"]
    write_text(path, "after ä")
    assert path.read_text(encoding="utf-8") == "after ä"
    assert [p.name for p in tmp_path.iterdir()] == ["it.txt"]


def test_a_file_is_durable_before_it_is_in_place_and_its_place_is_before_that_is_told(tmp_path, monkeypatch):
    done = []
    sync, replace = os.fsync, os.replace

    def synced(file):
        done.append("folder" if os.path.samestat(os.fstat(file), os.stat(tmp_path)) else "file")
        sync(file)

    def replaced(before, after):
        done.append("in place")
        replace(before, after)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(os, "replace", replaced)
    write_text(tmp_path / "it.txt", "it")
    assert done == ["file", "in place", "folder"]


def test_json_comes_back(tmp_path):
    write_json(tmp_path / "it.json", {"a": [1, 2.5, None], "b": "ä"})
    assert json.loads((tmp_path / "it.json").read_text()) == {"a": [1, 2.5, None], "b": "ä"}


def test_places_that_cannot_be_written_are_told(tmp_path):
    with pytest.raises(UnusableInput, match="does not exist; create it first"):
        write_text(tmp_path / "none" / "it", "x")
    (tmp_path / "folder").mkdir()
    with pytest.raises(UnusableInput, match="cannot be written"):
        write_text(tmp_path / "folder", "x")
    (tmp_path / "file").write_text("")
    with pytest.raises(UnusableInput, match="does not exist"):
        write_text(tmp_path / "file" / "it", "x")


def test_errors_carry_the_exit_codes_of_the_command_line():
    assert (PneumarmError.exit_code, UnusableInput.exit_code, ArmFailure.exit_code) == (1, 2, 1)
    assert issubclass(UnusableInput, PneumarmError)
    assert issubclass(ArmFailure, PneumarmError)


def test_arrays_that_a_disk_has_no_room_for_are_told_of(path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(PneumarmError, match=r"No space left on device.*free some space") as failure:
        write_arrays(path, "test", {}, ARRAYS)
    assert failure.value.exit_code == 1
    assert not list(path.parent.iterdir())
