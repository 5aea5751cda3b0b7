"""Ways to damage what pneumarm writes: bytes, the tensors and the header of a .safetensors, tables of a store."""

import json
import math
import random
import sqlite3
import struct
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

VALUES: tuple[Any, ...] = (None, -1, 0, 1e308, 10**30, "x", [], {}, "<script>alert(1)</script>", True, [[[]]], 10**9)
"""What may stand where something else is expected."""


def safetensors(header: Any, body: bytes, length: int | None = None) -> bytes:
    """Return a file of ``header``, bytes or what becomes JSON; it says that its header is ``length`` bytes long."""
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return struct.pack("<Q", len(text) if length is None else length) + text + body


def taken_apart(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the header and the body of a .safetensors."""
    length = struct.unpack("<Q", data[:8])[0]
    return json.loads(data[8 : 8 + length]), data[8 + length :]


def tensors_of(header: dict[str, Any]) -> list[str]:
    return [name for name in header if name != "__metadata__"]


def changed(header: dict[str, Any], name: str, change: dict[str, Any]) -> dict[str, Any]:
    """Return the header with other entries for a tensor."""
    return header | {name: header[name] | change}


def with_metadata(header: dict[str, Any], text: Any) -> dict[str, Any]:
    """Return the header with another text where pneumarm keeps what it knows of a file."""
    return header | {"__metadata__": {"pneumarm": text}}


def cuts(data: bytes) -> Iterator[tuple[str, bytes]]:
    """Yield files that are shorter, or longer, than they were."""
    yield "empty", b""
    yield "8 bytes", data[:8]
    yield "half", data[: len(data) // 2]
    yield "all but a byte", data[:-1]


def false_headers(data: bytes) -> Iterator[tuple[str, bytes]]:
    """Yield .safetensors whose header lies about lengths, shapes and types, or lacks something."""
    header, body = taken_apart(data)
    name = tensors_of(header)[0]
    yield "header longer than the file", safetensors(header, body, 1 << 62)
    yield "header cut by its length", safetensors(header, body, 10)
    for change in (
        {"shape": [1 << 40, 1 << 20]},
        {"shape": [-1]},
        {"shape": [1 << 63, 2]},
        {"dtype": "F99"},
        {"dtype": "BF16"},
        {"data_offsets": [100, 0]},
        {"shape": [1] * 200},
        {"shape": "x"},
    ):
        yield f"{name} {str(change)[:40]}", safetensors(changed(header, name, change), body)
    for gone in (name, "__metadata__"):
        yield f"no {gone}", safetensors({key: value for key, value in header.items() if key != gone}, body)


def false_metadata(data: bytes) -> Iterator[tuple[str, bytes]]:
    """Yield files whose kind or settings are none."""
    header, body = taken_apart(data)
    kind = json.dumps(json.loads(header["__metadata__"]["pneumarm"])["kind"])
    for text in (5, "{", "[]", "null"):
        yield f"metadata {text}", safetensors(with_metadata(header, text), body)
    for other in (5, [], "", "os:system", "os", ":", "os:path.join.x", "\x1b[2J\nfoo", "k" * 100_000):
        text = json.dumps({"kind": other, "settings": {}})
        yield f"kind {str(other)[:10]!r}", safetensors(with_metadata(header, text), body)
    deep = "[" * 50_000 + "]" * 50_000
    for settings in ("null", "[1, 2]", deep, '{"a": NaN}', '{"a": ' + "9" * 5_000 + "}"):
        text = f'{{"kind": {kind}, "settings": {settings}}}'
        yield f"settings {settings[:10]}", safetensors(with_metadata(header, text), body)


def false_weights(data: bytes, value: float) -> bytes:
    """Return the file with ``value`` in place of all its numbers."""
    header, body = taken_apart(data)
    found = bytearray(body)
    for name in tensors_of(header):
        letter = {"F32": "f", "F64": "d"}.get(header[name]["dtype"])
        if letter is not None:
            begin, end = header[name]["data_offsets"]
            width = struct.calcsize(letter)
            found[begin:end] = struct.pack(f"<{letter}", value) * ((end - begin) // width)
    return safetensors(header, bytes(found))


def leaves(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the ways to all values in dictionaries, and in the first two of a list of such."""
    if isinstance(value, dict):
        for key in value:
            yield from leaves(value[key], (*path, key))
    elif isinstance(value, list) and value and isinstance(value[0], dict | list):
        for place, one in enumerate(value[:2]):
            yield from leaves(one, (*path, place))
    elif path:
        yield path


def replaced(value: Any, path: tuple[Any, ...], other: Any) -> Any:
    """Return a copy of nested dictionaries and lists with another value at the end of a way."""
    copy = json.loads(json.dumps(value))
    inner = copy
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = other
    return copy


def false_settings(data: bytes, each: int) -> Iterator[tuple[str, Callable[[], bytes]]]:
    """Yield files with another value for a setting, ``each`` for each of them."""
    header, body = taken_apart(data)
    known = json.loads(header["__metadata__"]["pneumarm"])
    rng = random.Random(3)
    for path in leaves(known["settings"]):
        for value in rng.sample(VALUES, each):

            def made(path: tuple[Any, ...] = path, value: Any = value) -> bytes:
                settings = replaced(known["settings"], path, value)
                return safetensors(with_metadata(header, json.dumps(known | {"settings": settings})), body)

            yield f"{'.'.join(map(str, path))} = {str(value)[:20]}", made


def flipped(data: bytes, seed: int) -> bytes:
    """Return the bytes with one, three or twenty of them changed."""
    rng, found = random.Random(seed), bytearray(data)
    for _ in range(rng.choice((1, 3, 20))):
        found[rng.randrange(len(found))] = rng.randrange(256)
    return bytes(found)


def with_nan(data: bytes) -> bytes:
    return false_weights(data, math.nan)


Statement = str | tuple[str, Any] | Callable[[sqlite3.Connection], object]
"""SQL, SQL with its values, or what is done with a connection."""


def alter(path: Path, *statements: Statement) -> None:
    """Change a store behind pneumarm's back."""
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("PRAGMA journal_mode = DELETE")
        connection.execute("BEGIN")
        for one in statements:
            if callable(one):
                one(connection)
            else:
                connection.execute(*((one,) if isinstance(one, str) else one))
        connection.execute("COMMIT")


def spoilt_pages(data: bytes, number: int) -> bytes:
    """Return a database that is cut, or with some bytes, its header's bytes, or a page replaced."""
    rng, found, page = random.Random(number), bytearray(data), 4096
    if number % 4 == 0:
        return data[: rng.randrange(100, len(data))]
    if number % 4 == 1:
        begin = rng.randrange(100, len(data) - page)
        found[begin : begin + rng.choice((1, 16, page))] = rng.randbytes(16)
    elif number % 4 == 2:
        found[rng.randrange(16, 100)] = rng.randrange(256)
    else:
        begin = page * rng.randrange(1, len(data) // page)
        found[begin : begin + page] = data[:page] if number % 8 == 3 else bytes(page)
    return bytes(found)
