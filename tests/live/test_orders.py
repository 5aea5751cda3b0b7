"""What comes from a page is an order, or refused before anything happens."""

import json

import pytest

from pneumarm.errors import UnusableInput
from pneumarm.live.orders import FollowCurve, GoTo, Stop, read_order


def test_orders_are_read() -> None:
    assert read_order('{"do": "stop"}', 1) == Stop()
    assert read_order('{"do": "goal", "degrees": [20, -5.5]}', 2) == GoTo([20.0, -5.5])
    assert read_order('{"do": "draw", "seconds": [0, 1], "degrees": [[3], [4]]}', 1) == FollowCurve(
        [0, 1], [[3.0], [4.0]]
    )


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{",
        '{"do": "explode"}',
        '{"do": "goal"}',
        '{"do": "goal", "degrees": [1, 2]}',
        '{"do": "goal", "degrees": [NaN]}',
        '{"do": "goal", "degrees": [1e999]}',
        '{"do": "goal", "degrees": ["1"]}',
        '{"do": "goal", "degrees": [1], "twice": true}',
        '{"do": "draw", "seconds": [], "degrees": []}',
        '{"do": "draw", "seconds": [0, 0], "degrees": [[1], [2]]}',
        '{"do": "draw", "seconds": [1, 2], "degrees": [[1], [2]]}',
        '{"do": "draw", "seconds": [0, 1], "degrees": [[1]]}',
        '{"do": "draw", "seconds": [0, 1], "degrees": [[1], [2, 3]]}',
        '{"do": "draw", "seconds": [0, 1e9], "degrees": [[1], [2]]}',
        json.dumps({"do": "draw", "seconds": list(range(5000)), "degrees": [[0]] * 5000}),
        "[" * 100_000,
    ],
)
def test_nothing_else_is(text: str) -> None:
    with pytest.raises(UnusableInput):
        read_order(text, 1)
