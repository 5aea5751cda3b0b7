"""The cache of compiled kernels serves no stale code, none it cannot keep, and always the same."""

import os
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from children import python
from pneumarm.kernels import borrowed, inner, kernel, part, sources_hash

LEFT = """
from pneumarm.kernels import kernel
@kernel
def factor(x):
    return x * {factor}
"""

RIGHT = """
from pneumarm.kernels import kernel
from left import factor
@kernel
def result(x):
    return factor(x) + 1.0
"""

# The package's own folder decides the name of the cache's folder, so the modules lie in a copy of its ground.
SCRIPT = """
import sys
from pneumarm.right import result
print(result(2.0), sum(result.stats.cache_hits.values()), sum(result.stats.cache_misses.values()))
"""


@pytest.fixture
def package(tmp_path):
    """A package ``pneumarm`` of kernels.py and two files, one of which calls a kernel of the other."""
    import pneumarm.kernels

    folder = tmp_path / "source" / "pneumarm"
    folder.mkdir(parents=True)
    (folder / "__init__.py").write_text("")
    (folder / "kernels.py").write_bytes(Path(pneumarm.kernels.__file__).read_bytes())
    (folder / "left.py").write_text(LEFT.format(factor=3.0))
    (folder / "right.py").write_text(RIGHT.replace("from left", "from pneumarm.left"))
    return folder


@pytest.fixture
def run(package, tmp_path):
    """Call the kernel in a process of its own; returns its result, cache hits and misses."""

    def call(cache=tmp_path / "cache", **environment):
        inside = {"PYTHONPATH": str(package.parent), "PNEUMARM_CACHE": str(cache), **environment}
        done = python("-c", SCRIPT, env=os.environ | inside, check=True)
        value, hits, misses = done.stdout.split()
        return float(value), int(hits), int(misses)

    return call


@pytest.fixture
def compiled(run, tmp_path):
    """The cache's folder after a first process."""
    run()
    return tmp_path / "cache"


def entries(folder, pattern):
    return sorted(folder.rglob(pattern))


def test_a_change_in_another_files_kernel_is_seen(run, package, tmp_path):
    assert run() == (7.0, 0, 1)
    left = package / "left.py"
    before = left.stat()
    left.write_text(LEFT.format(factor=5.0))
    os.utime(left, ns=(before.st_atime_ns, before.st_mtime_ns))  # not even the time of the file tells
    assert run()[0] == 11.0
    left.write_text(LEFT.format(factor=3.0))
    assert run() == (7.0, 1, 0)  # going back finds what was compiled then


def test_entries_that_a_power_cut_emptied_are_compiled_again(run, compiled):
    for entry in (found := entries(compiled, "*.nb[ic]")):
        entry.write_bytes(b"")
    assert found
    assert run() == (7.0, 0, 1)
    assert run() == (7.0, 1, 0)  # and what replaced them is whole


def test_a_cache_that_cannot_be_written_does_not_stop_anything(run, tmp_path):
    file = tmp_path / "a-file"
    file.write_text("")
    assert run(cache=file / "below", TMPDIR=str(tmp_path))[0] == 7.0


def test_folders_of_old_sources_are_forgotten(run, tmp_path):
    cache = tmp_path / "cache"
    for age in range(5):
        (cache / str(age)).mkdir(parents=True)
        os.utime(cache / str(age), (1e9 - age, 1e9 - age))
    run()
    left = {folder.name for folder in cache.iterdir()}
    assert len(left) == 3
    assert left > {"0", "1"}


def test_the_hash_is_of_kernel_sources_only(package):
    before = sources_hash(package)
    (package / "notes.py").write_text("x = 1\n")
    assert sources_hash(package) == before
    (package / "more.py").write_text("from pneumarm.kernels import kernel\n")
    assert sources_hash(package) != before


def test_a_kernel_may_make_arrays_also_where_a_part_is_the_first_to_call_it():
    @kernel
    def total(x):
        return np.empty_like(x).size + x.sum()

    @part
    def inside(x):
        return total(x) + 1.0

    outer = kernel(lambda x: inside(x))
    assert outer(np.ones(3)) == 7.0


def test_what_is_for_kernels_may_be_called_by_python_as_well():
    @inner
    def twice(x):
        return 2.0 * x

    outer = kernel(lambda x: twice(x) + 1.0)
    assert (twice(1.0), outer(1.0), [twice(2.0)]) == (2.0, 3.0, [4.0])


def test_a_part_with_an_entry_is_called_from_python_and_from_kernels():
    @part(entry=True)
    def twice(x):
        return 2.0 * x

    assert twice(1.0) == 2.0
    assert kernel(lambda x: twice(x) + 1.0)(1.0) == 3.0


class Pair(NamedTuple):
    """Arrays as parts are given them."""

    here: Any
    there: Any


def test_a_kernel_that_borrows_leaves_its_arguments_whole():
    @part
    def inside(pair, factor):
        pair.here[0] += factor * pair.there[1, 0]

    @kernel
    def outer(pair, factors):
        pair, factors = borrowed((pair, factors))
        for i in range(factors.shape[0]):
            inside(pair, factors[i])

    pair, factors = Pair(np.zeros(2), np.eye(2)[::-1].copy()), np.arange(3.0)
    before = [sys.getrefcount(one) for one in (*pair, factors)]
    for _ in range(3):
        outer(pair, factors)
    assert pair.here[0] == 9.0
    assert [sys.getrefcount(one) for one in (*pair, factors)] == before


# As with a version of Numba whose arrays look otherwise.
PLAIN = """
import llvmlite.ir
import numpy as np
from numba import extending

def refused(*_):
    raise NotImplementedError

llvmlite.ir.IRBuilder.extract_value, kept = refused, llvmlite.ir.IRBuilder.extract_value
import pneumarm.kernels
llvmlite.ir.IRBuilder.extract_value = kept
from pneumarm.kernels import EXTENDED, borrowed, kernel
from pneumarm.vectors import add_sums, weighted_sums

@kernel
def both(x, table, sums, out):
    x, table = borrowed((x, table))
    weighted_sums(x, table, 0, sums)
    add_sums(table, x.copy().reshape(-1, 1) * np.ones((1, 3), np.float32), out)

sums, out = np.zeros(8, np.float32), np.zeros((8, 3), np.float32)
both(np.ones(4, np.float32), np.ones((4, 8), np.float32), sums, out)
print(EXTENDED, sums.sum(), out.sum())
"""


def test_loops_are_plain_where_code_made_by_hand_does_not_fit_numba(tmp_path):
    done = python("-c", PLAIN, env=os.environ | {"PNEUMARM_CACHE": str(tmp_path)}, check=True)
    assert done.stdout == "False 32.0 96.0\n"


def test_division_follows_numpy():
    @kernel
    def divide(a, b):
        return a / b

    assert divide(1.0, 0.0) == np.inf
    assert np.isnan(divide(0.0, 0.0))


# The second process finds `two` in the cache and numbers `by_three` as the first one numbered `by_two`.
FAMILY = """
from pneumarm.kernels import kernel
def make(factor):
    @kernel
    def times(x):
        return x * factor
    return times
by_two, by_three = make(2.0), make(3.0)
@kernel
def two(x):
    return by_two(x)
@kernel
def three(x):
    return by_three(x)
@kernel
def first(x):
    return two(x)
@kernel
def both(x):
    return two(x) + 100.0 * three(x)
"""


def test_kernels_of_one_factory_are_told_apart_also_where_one_comes_from_the_cache(package, tmp_path):
    (package / "family.py").write_text(FAMILY)
    inside = os.environ | {"PYTHONPATH": str(package.parent), "PNEUMARM_CACHE": str(tmp_path / "cache")}
    found = [
        python("-c", f"from pneumarm.family import *; print({name}(1.0))", env=inside, check=True).stdout
        for name in ("first", "both")
    ]
    assert found == ["2.0\n", "302.0\n"]


FOREIGN = """
import numba
import numpy as np
import pneumarm.kernels
from numba.experimental import jitclass

@numba.njit(cache=True)
def more(x):
    return x + 1.0
@numba.njit(cache=True)
def twice(x):
    return 2.0 * more(x)
@numba.njit(parallel=True, cache=True)
def total(x):
    sum_ = 0.0
    for i in numba.prange(len(x)):
        sum_ += more(x[i])
    return sum_
@numba.vectorize(["float64(float64)"])
def each(x):
    return more(x)
@numba.guvectorize(["void(float64[:], float64[:])"], "(n)->(n)")
def all_(x, out):
    for i in range(len(x)):
        out[i] = more(x[i])
@numba.cfunc("float64(float64)")
def address(x):
    return more(x)
@numba.njit
def applied(function, x):
    return function(x)
@numba.njit
def factorial(n):
    return 1 if n < 2 else n * factorial(n - 1)
@numba.njit
def text(x):
    with numba.objmode(y="float64"):
        y = float(str(x))
    return y
@numba.njit
def refused(x):
    if x > 1.0:
        raise ValueError("above 1", x)
@jitclass([("a", numba.float64)])
class Holder:
    def __init__(self, a):
        self.a = a
    def more(self):
        return more(self.a)

print(twice(1.0), total(np.ones(3)), each(np.ones(1))[0], all_(np.ones(1))[0], address.ctypes(2.0))
print(applied(more, 1.0), factorial(4), text(2.5), Holder(1.0).more())
try:
    refused(2.0)
except ValueError as error:
    print(error.args)
"""


def test_what_others_compile_with_numba_in_the_same_process_works(package, tmp_path):
    (tmp_path / "foreign.py").write_text(FOREIGN)
    inside = os.environ | {"PYTHONPATH": str(package.parent), "PNEUMARM_CACHE": str(tmp_path / "cache")}
    for _ in ("compiled", "from the cache"):
        said = python(str(tmp_path / "foreign.py"), env=inside, check=True).stdout
        assert said == "4.0 6.0 2.0 2.0 3.0\n2.0 24 2.5 2.0\n('above 1', 2.0)\n"


# Sums run in another order where a kernel calls another copy of a kernel than it did: the last bits show it.
IMPROVED = """
import hashlib
import numpy as np
from pneumarm.learning import PolicySettings
from pneumarm.learning.policy.proximal import batch, improve_policy
from pneumarm.learning.policy.agent import rule
from pneumarm.networks.layers import initial_weights, trainable
from pneumarm.random import random_state

random, steps, arms, hidden = np.random.default_rng(1), 8, 16, (13, 32)
policy = trainable(initial_weights((*hidden, 9), 1.0, random), (*hidden, 9), arms)
value = trainable(initial_weights((*hidden, 1), 1.0, random), (*hidden, 1), arms)
made_up = batch(steps, hidden[0], 1, arms)
for part in (made_up.inputs, made_up.reward):
    part[:] = random.normal(size=part.shape)
improve_policy(rule(PolicySettings()), policy, value, made_up, (1e-3, 1e-3), 0, random_state((1,)))
print(hashlib.sha256(policy.flat.tobytes() + value.flat.tobytes()).hexdigest())
"""
TRAINED = """
import hashlib, sys
sys.path.insert(0, {learning!r})
from synthetic_arm import synthetic_begin_states, synthetic_simulation
from pneumarm.learning import BatchedSettings, PolicySettings, Shaping, TrainSettings, train

simulation = synthetic_simulation()
begin, small = synthetic_begin_states(simulation), {{"agents": 1, "validation_episodes": 10}}
for settings in (
    PolicySettings(updates=2, arms=16, steps=8, **small),
    BatchedSettings(updates=2, arms=16, steps=8, **small),
    TrainSettings(max_episodes=100, shaping=Shaping(episodes=10), **small),
):
    agent = train(simulation, begin, settings, seed=1).agent
    print(hashlib.sha256(agent.weights().tobytes()).hexdigest())
"""
LEARNING = str(Path(__file__).parent / "learning")


@pytest.mark.parametrize(
    "script", [IMPROVED, pytest.param(TRAINED.format(learning=LEARNING), marks=pytest.mark.soak)], ids=["one", "all"]
)
def test_the_same_bits_come_whether_code_was_compiled_or_loaded(script, tmp_path):
    def results(cache):
        return python("-c", script, env=os.environ | {"PNEUMARM_CACHE": str(tmp_path / cache)}, check=True).stdout

    with ThreadPoolExecutor() as pool:
        compiled, again = pool.map(results, ["one", "other"])
    loaded = results("one")
    assert len(compiled.split()[0]) == 64
    assert compiled == loaded == again


@pytest.mark.skipif(os.name == "nt", reason="needs owners of files")
@pytest.mark.parametrize("made", ["open to all", "a link", "of somebody else"])
def test_a_cache_that_others_can_write_to_is_not_used(tmp_path, monkeypatch, made):
    import pneumarm.kernels

    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    place = tmp_path / f"pneumarm-{os.getuid()}"
    if made == "open to all":
        place.mkdir()
        place.chmod(0o777)
    elif made == "a link":
        (tmp_path / "theirs").mkdir()
        place.symlink_to(tmp_path / "theirs")
    else:
        monkeypatch.setattr("os.getuid", lambda: os.stat(tmp_path).st_uid + 1)
        (tmp_path / f"pneumarm-{os.getuid()}").mkdir()
    own = pneumarm.kernels._own_folder()
    assert own.parent == tmp_path
    assert own.name not in (place.name, f"pneumarm-{os.getuid()}")
    assert own.stat().st_mode & 0o077 == 0


def test_a_cache_among_temporary_files_is_found_again(tmp_path, monkeypatch):
    import pneumarm.kernels

    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    own = pneumarm.kernels._own_folder()
    assert own == pneumarm.kernels._own_folder()
    assert os.name == "nt" or own.stat().st_mode & 0o077 == 0
