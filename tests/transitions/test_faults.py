"""Kills, power cuts, full and broken disks, files that are no stores: nothing acknowledged is lost, nothing hangs."""

import os
import shutil
import sqlite3

import numpy as np
import pytest
from stand_ins import FirstOrderArm, make_recorded

from pneumarm.arm import ArmSpec
from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.transitions import CollectSettings, Store, collect

# Forks writers and kills them with -9 a random time after some acknowledgement, or after none; each goes on where
# the one before was killed.
KILLS = """
import os, random, signal, sys, time
from pathlib import Path
import numpy as np
from pneumarm.arm import ArmSpec
from pneumarm.transitions import Store
from stand_ins import make_recorded

path, kills, seed = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
random.seed(seed)
acknowledged = -1

def write(pipe):
    store = Store.append_to(path) if path.exists() else Store.create(path, ArmSpec())
    while True:
        number = store.append(make_recorded(store.sequences + 1, n=101), {"arm": b"%d" % (store.sequences + 1)})
        os.write(pipe, b"%d " % number)

for kill in range(kills):
    read_end, write_end = os.pipe()
    child = os.fork()
    if child == 0:
        write(write_end)
    os.close(write_end)
    acknowledgements = b""
    for _ in range(random.choice((0, 0, 1, 2, 4))):
        acknowledgements += os.read(read_end, 1000)
    time.sleep(random.choice((0.0005, 0.005, 0.03)) * random.random())
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    with os.fdopen(read_end, "rb") as pipe:
        numbers = [int(n) for n in (acknowledgements + pipe.read()).split()]
    acknowledged = max([acknowledged, *numbers])
    if not path.exists():
        assert acknowledged == -1
        continue
    with Store.append_to(path) as store:
        stored = store.sequences
        assert stored >= acknowledged, f"{acknowledged} acknowledged, {stored} stored"
        assert store.state() == (b"%d" % stored if stored else None)
    if kill % 20 == 0 or kill == kills - 1:
        with Store.open(path) as store:
            store.check()
            for block in store:
                for number in np.unique(block.sequence):
                    expected = make_recorded(int(number), n=101)
                    mine = block.sequence == number
                    assert (block.angle[mine] == expected.angle).all()
                    assert np.array_equal(block.command[mine], expected.command, equal_nan=True)
print(kills, "kills", acknowledged, "acknowledged")
"""


def killed(python, path, kills, seed):
    done = python(KILLS, path, kills, seed)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"{kills} kills")
    print(done.stdout, end="")  # pytest -s shows it
    return int(done.stdout.split()[2])


def test_kills_while_writing_lose_nothing_acknowledged(python, tmp_path):
    assert killed(python, tmp_path / "transitions.db", 30, 1) > 30


@pytest.mark.soak
def test_a_thousand_kills_while_writing_lose_nothing_acknowledged(python, tmp_path):
    for seed in range(10):
        assert killed(python, tmp_path / f"{seed}.db", 100, seed) > 100


def power_cut_states(folder, sequences):
    """Write sequences one by one; return the bytes of store and log as acknowledged each time, and of all."""
    path = folder / "written.db"
    log = folder / "written.db-wal"
    states = []
    with Store.create(path, ArmSpec()) as store:
        for i in range(sequences):
            store.append(make_recorded(i + 1, n=41))
            states.append((path.read_bytes(), log.read_bytes()))
    return states


def survivors(folder, database, log):
    """Return what is left after a power cut that left these bytes."""
    path = folder / "cut.db"
    for leftover in folder.glob("cut.db*"):
        leftover.unlink()
    path.write_bytes(database)
    path.with_name("cut.db-wal").write_bytes(log)
    with Store.append_to(path) as store:
        store.check()
        for block in store:
            for number in np.unique(block.sequence):
                expected = make_recorded(int(number), n=41)
                np.testing.assert_array_equal(block.angle[block.sequence == number], expected.angle)
        return store.sequences


def cut_anywhere(folder, sequences, per_sequence, seed):
    """Drop or garble what was written after each acknowledgement, as a disk may that had not been told to sync."""
    random = np.random.default_rng(seed)
    states = power_cut_states(folder, sequences)
    for k in range(1, len(states)):
        (_, log), (database, longer) = states[k - 1], states[k]
        assert longer[: len(log)] == log  # the log only grows here
        for _ in range(per_sequence):
            kind = random.integers(3)
            end = int(random.integers(len(log), len(longer) + 1))
            tail = bytearray(longer[len(log) : end if kind == 0 else len(longer)])
            for sector in range(0, len(tail) if kind else 0, 512):
                if random.random() < 0.5:
                    size = min(512, len(tail) - sector)
                    tail[sector : sector + size] = bytes(size) if kind == 1 else random.bytes(size)
            assert survivors(folder, database, log + bytes(tail)) >= k


def test_a_power_cut_loses_nothing_acknowledged(tmp_path):
    cut_anywhere(tmp_path, 5, 12, seed=0)


@pytest.mark.soak
def test_many_power_cuts_lose_nothing_acknowledged(tmp_path):
    cut_anywhere(tmp_path, 40, 100, seed=1)


def test_a_power_cut_while_the_log_is_moved_into_the_store_loses_nothing(tmp_path):
    path = tmp_path / "written.db"
    with Store.create(path, ArmSpec()) as store:
        for i in range(8):
            store.append(make_recorded(i + 1, n=41))
        before, log = path.read_bytes(), path.with_name("written.db-wal").read_bytes()
    after = path.read_bytes()  # closing moves the log into the store
    random = np.random.default_rng(0)
    for _ in range(20):
        moved = bytearray(before.ljust(len(after), b"\0"))
        for page in range(0, len(after), 4096):
            if random.random() < 0.5:
                moved[page : page + 4096] = after[page : page + 4096]
        assert survivors(tmp_path, bytes(moved), log) == 8


def test_a_full_disk_is_told_and_rolled_back(tmp_path, recorded):
    path = tmp_path / "s.db"
    with Store.create(path, ArmSpec()) as store:
        store.append(recorded(1))
        pages = store._one("PRAGMA page_count")
        store.database.connection.execute(f"PRAGMA max_page_count = {pages + 2}")
        with pytest.raises(PneumarmError, match="the disk is full; free some space") as failure:
            all(store.append(recorded(2 + i)) for i in range(1000))
        assert failure.value.exit_code == 1
        kept = store.sequences
        store.check()
        store.database.connection.execute("PRAGMA max_page_count = 1000000")
        assert store.append(recorded(9)) == kept + 1  # and on it goes


def test_a_file_that_may_not_grow_is_told_and_rolled_back(tmp_path, python):
    script = """
import resource, sys
from pneumarm.arm import ArmSpec
from pneumarm.errors import PneumarmError
from pneumarm.transitions import Store
from stand_ins import make_recorded
store = Store.create(sys.argv[1], ArmSpec())
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, resource.RLIM_INFINITY))
try:
    for i in range(1000):
        number = store.append(make_recorded(i + 1, n=101))
except PneumarmError as error:
    print(number, error.exit_code, error)
"""
    done = python(script, tmp_path / "s.db")
    assert done.returncode == 0, done.stderr
    number, code, message = done.stdout.split(maxsplit=2)
    assert code == "1"
    assert "what was acknowledged is safe" in message
    assert "\n" not in message.strip()
    with Store.append_to(tmp_path / "s.db") as store:
        assert store.sequences == int(number) > 3
        store.check()


def test_a_read_only_disk_is_told_and_closes_the_arm(tmp_path):
    arm = FirstOrderArm()
    with Store.create(tmp_path / "s.db", arm.spec) as store:

        def then_read_only(done, total):
            store.database.connection.execute("PRAGMA query_only = ON")

        with pytest.raises(PneumarmError, match="read-only") as failure:
            collect(arm, store, 2000, settings=CollectSettings(actions=20), progress=then_read_only)
        assert failure.value.exit_code == 1
        assert arm.closed
        assert store.sequences == 1
        store.check()


@pytest.fixture
def whole(tmp_path):
    """A closed store of 20 sequences."""
    path = tmp_path / "whole.db"
    with Store.create(path, ArmSpec()) as store:
        store.append_all(make_recorded(i + 1) for i in range(20))
    return path


def refused_or_sound(path):
    """Return whether the store is refused, as opposed to giving what was put in."""
    try:
        with Store.open(path) as store:
            store.check()
            return False
    except UnusableInput:
        return True


def test_truncated_stores_are_refused(whole, tmp_path):
    data = whole.read_bytes()
    for size in [0, 1, 15, 16, 99, 100, 1000, 4095, 4096, *range(5000, len(data) - 1, 3000)]:
        path = tmp_path / "cut.db"
        path.write_bytes(data[:size])
        assert refused_or_sound(path), size


def test_garbled_stores_are_refused_or_still_sound_and_never_crash(whole, tmp_path):
    data = whole.read_bytes()
    random = np.random.default_rng(0)
    refused = 0
    for _ in range(100):
        garbled = bytearray(data)
        begin = int(random.integers(len(data)))
        garbled[begin : begin + 16] = random.bytes(16)
        path = tmp_path / "garbled.db"
        path.write_bytes(garbled[: len(data)])
        refused += refused_or_sound(path)
    assert refused > 10


def altered(whole, *statements):
    path = whole.with_name("altered.db")
    shutil.copy(whole, path)
    connection = sqlite3.connect(path, isolation_level=None)
    for statement in statements:
        connection.execute(statement)
    connection.close()
    return path


HUGE_VIEW = """CREATE VIEW rows AS WITH RECURSIVE more(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM more)
SELECT 1 AS sequence, n AS step, 0.0 AS time, 0.0 AS joint_1_angle, 0.0 AS joint_1_pressure_1,
0.0 AS joint_1_pressure_2, 0 AS joint_1_command_1, 0 AS joint_1_command_2 FROM more"""


@pytest.mark.parametrize(
    ("statements", "message"),
    [
        (["PRAGMA user_version = 99"], "a store of version 99"),
        (["PRAGMA application_id = 5"], "another program's database"),
        (["DROP TABLE rows"], "its tables are not those of a store"),
        (["DROP TABLE rows", HUGE_VIEW], "its tables are not those of a store"),
        (["CREATE TRIGGER t AFTER INSERT ON rows BEGIN DELETE FROM rows; END"], "its tables are not those"),
        (["UPDATE store SET value = json_set(value, '$.joints', 1000000000) WHERE name = 'spec'"], "joints"),
        (["UPDATE store SET value = json_set(value, '$.joints', 2) WHERE name = 'spec'"], "its tables are not those"),
        (["UPDATE store SET value = json_set(value, '$.period', -1) WHERE name = 'spec'"], "period"),
        (["UPDATE store SET value = '{' WHERE name = 'spec'"], "its arm cannot be read"),
        (["UPDATE store SET value = CAST(zeroblob(100000000) AS TEXT) WHERE name = 'spec'"], "too big"),
        (["UPDATE sequences SET rows = 1000000000000 WHERE number = 3"], "impossible lengths"),
        (["UPDATE sequences SET rows = 22 WHERE number = 3"], "rows are missing"),
        (["UPDATE sequences SET rows = 20 WHERE number = 20"], "impossible values"),
        (["DELETE FROM sequences WHERE number = 3"], "not numbered from 1"),
        (["DELETE FROM sequences WHERE number = 20"], "does not agree"),
        (["DELETE FROM rows WHERE sequence = 20 AND step = 20"], "rows are missing"),
        (["UPDATE rows SET joint_1_angle = 9e999 WHERE sequence = 2 AND step = 5"], "impossible values"),
        (["UPDATE rows SET joint_1_angle = 'x' WHERE sequence = 2 AND step = 5"], "not numbers"),
        (["UPDATE rows SET joint_1_command_2 = NULL WHERE sequence = 2 AND step = 5"], "impossible values"),
        (["UPDATE rows SET joint_1_command_2 = 1.5 WHERE sequence = 2 AND step = 5"], "impossible values"),
        (["UPDATE rows SET step = 100 WHERE sequence = 2 AND step = 5"], "impossible values|does not agree"),
        (["UPDATE rows SET time = 100 WHERE sequence = 2 AND step = 5"], "impossible values"),
    ],
)
def test_altered_stores_are_refused(whole, statements, message):
    path = altered(whole, *statements)
    with pytest.raises(UnusableInput, match=message), Store.open(path) as store:
        store.check()


@pytest.mark.parametrize(
    "change",
    [
        "UPDATE sequences SET rows = 'many'",
        "UPDATE sequences SET info = '{'",
        "UPDATE sequences SET info = '[1]'",
        "UPDATE sequences SET info = x'ff'",
        "INSERT INTO runs VALUES (7, 'collect', 'null')",
        "INSERT INTO runs VALUES (7, 'collect', '" + "[" * 30_000 + "')",
    ],
)
def test_a_catalogue_of_something_else_is_said(whole, change):
    path = altered(whole, change)

    def read():
        with Store.open(path) as store:
            list(store.catalogue())
            store.runs()

    with pytest.raises(UnusableInput, match="damaged"):
        read()


def test_things_that_are_no_files_are_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "fifo.db")
    (tmp_path / "folder.db").mkdir()
    for name in ("fifo.db", "folder.db"):
        with pytest.raises(UnusableInput, match="this is not a file"):
            Store.open(tmp_path / name)
        with pytest.raises(UnusableInput, match="this is not a file"):
            Store.append_to(tmp_path / name)
        with pytest.raises(UnusableInput, match="exists already"):
            Store.create(tmp_path / name, ArmSpec())


LIMITED = """
import resource, sys
from pneumarm.transitions import Store, import_recording
from pneumarm.errors import UnusableInput
import sqlite3, csv, tomllib, msgspec
sqlite3.connect(":memory:").execute("SELECT 1")
with open("/proc/self/statm") as file:
    used = int(file.read().split()[0]) * resource.getpagesize()
limit = used + (64 << 20)
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
for argument in sys.argv[1:]:
    try:
        ACTION
    except UnusableInput as error:
        print(repr(str(error)))
"""


@pytest.fixture
def limited(python):
    """Run an action on each of the arguments that must be refused within 64 MB; returns the messages."""

    def run(action, *arguments):
        done = python(LIMITED.replace("ACTION", action), *arguments)
        assert done.returncode == 0, done.stderr
        messages = done.stdout.splitlines()
        assert len(messages) == len(arguments)
        assert all(len(message) < 1000 for message in messages)
        return messages

    return run


def test_huge_stores_are_refused_in_little_memory(whole, tmp_path, limited):
    big = altered(whole, "UPDATE store SET value = CAST(zeroblob(300000000) AS TEXT) WHERE name = 'spec'")
    big = big.rename(tmp_path / "big.db")
    with open(tmp_path / "sparse.db", "wb") as file:
        file.truncate(1 << 40)
    joints = altered(whole, "UPDATE store SET value = json_set(value, '$.joints', 1000000000) WHERE name = 'spec'")
    messages = limited("Store.open(argument).check()", big, tmp_path / "sparse.db", joints)
    for message, expected in zip(messages, ("too big", "something else", "joints"), strict=True):
        assert expected in message


GOOD_MAPPING = """commands = "valves"
[arm]
period = 0.1
[[joint]]
angle = {column = "a", unit = "counts"}
pressure_1 = {column = "p", unit = "counts"}
pressure_2 = {column = "q", unit = "counts"}
command_1 = {column = "c"}
command_2 = {column = "d"}
"""


def test_hostile_recordings_are_refused_in_little_memory(tmp_path, limited):
    (tmp_path / "m.toml").write_text(GOOD_MAPPING)
    columns = "a,p,q,c,d\n"
    hostile = {
        "longer than": columns + "0" * 100_000,
        "line": columns + '"' + "1\n" * 1_000_000,
        "expected 5 fields": columns + "1," * 30_000 + "\n",
        "UTF-8": b"\xff\xfe\x00" * 1000,
        "expected a finite number": columns + "1,1,1,0,0\n" * 20_000 + "1,1,1,0,x\n" * 2_000,
    }
    recordings = [tmp_path / f"{n}.csv" for n in range(len(hostile))]
    for path, text in zip(recordings, hostile.values(), strict=True):
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    endless = tmp_path / "endless.csv"
    with open(endless, "wb") as file:
        file.truncate(1 << 36)  # one line of 64 GB
    action = f"import_recording(argument, {str(tmp_path / 'm.toml')!r}, {str(tmp_path / 's.db')!r})"
    messages = limited(action, *recordings, endless)
    for message, expected in zip(messages, [*hostile, "longer than"], strict=True):
        assert expected in message
    assert not list(tmp_path.glob("*s.db*"))


def hostile_mappings():
    """Yield mappings that are broken, or made to take much time or memory."""
    yield "x = 1\n" * 5_000_000
    yield "a = " + "[" * 15_000
    yield "a = " + "[" * 990
    yield "a" + ".a" * 7_500 + " = 1"
    yield "".join(f"{part}" + f".{part}" * 490 + " = 1\n" for part in "abcdefghijklmnop")
    yield "\x00"
    yield "[arm]\n" * 2
    yield 'commands = "valves"\njoint = []\n[arm]\nperiod = nan'


def test_hostile_mappings_are_refused_in_little_memory(tmp_path, limited):
    mappings = []
    for number, text in enumerate(hostile_mappings()):
        mappings.append(tmp_path / f"{number}.toml")
        mappings[-1].write_text(text)
    (tmp_path / "r.csv").write_text("a,p,q,c,d\n1,1,1,0,0\n1,1,1,0,0\n")
    action = f"import_recording({str(tmp_path / 'r.csv')!r}, argument, {str(tmp_path / 's.db')!r})"
    for path, message in zip(mappings, limited(action, *mappings), strict=True):
        assert path.name in message
    assert not list(tmp_path.glob("*s.db*"))
