"""A table: the variables are cut into cells, and each combination of them has a value of its own (section 4.2.6).

Source: Sutton and Barto, Reinforcement Learning, section 9.3 (state aggregation).
"""

import numpy as np

from pneumarm.kernels import part
from pneumarm.learning.values.approximators.coding import TABLE, Coding, coding


def table(cells: tuple[int, ...]) -> Coding:
    """Return a table of so many ``cells`` a variable."""
    return coding(TABLE, int(np.prod(cells)), 1, len(cells), cells)


@part(entry=True)
def cell_of(cells, z):  # type: ignore[no-untyped-def]
    """Return the number of the cell that ``z`` (variables,) lies in."""
    index = 0
    for i in range(cells.shape[0]):
        index = index * cells[i] + min(max(int(z[i] * cells[i]), 0), cells[i] - 1)
    return index


@part
def write_table(coding, z, places, amounts):  # type: ignore[no-untyped-def]
    """Write the one feature of ``z`` (variables,); return 1."""
    places[0], amounts[0] = cell_of(coding.cells, z), np.float32(1.0)
    return 1
