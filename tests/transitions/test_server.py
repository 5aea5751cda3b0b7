"""A store on a server: one writer, nothing acknowledged is lost, errors are for people, no password is shown."""

import os
import re
import signal
import socket
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from servers import PASSWORD
from stand_ins import FirstOrderArm, make_recorded

from children import child, end
from pneumarm import cli
from pneumarm.address import ServerAddress, address_of, masked
from pneumarm.arm import ArmSpec
from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.transitions import CollectSettings, Mark, Store, collect
from pneumarm.transitions.copying import copy_store

SHORT = CollectSettings(actions=100, pulses=0.0)


def content(address, run=None):
    with Store.open(address) as store:
        rows = [[*vars(block).values()] for block in store.blocks(marked=True)]
        entries = list(store.catalogue(run))
        return store.spec, store.valves, rows, entries, store.marks(), store.runs(), store.state()


def assert_same(one, other):
    np.testing.assert_equal(content(one), content(other))


def numbered(store):
    """Check that every sequence is the one that was made for its number."""
    for block in store:
        for number in np.unique(block.sequence).tolist():
            np.testing.assert_array_equal(block.angle[block.sequence == number], make_recorded(number).angle)


# ---- addresses


@pytest.mark.parametrize(
    ("url", "shown"),
    [
        ("postgresql://lab@server/rig1", "postgresql://lab@server/rig1"),
        ("postgresql://lab:secret@server:5433/rig1", "postgresql://lab:***@server:5433/rig1"),
        ("mysql://lab:se@c:ret@server/rig1", "mysql://lab:***@server/rig1"),
        (
            "mariadb://lab:secret@server/rig1?ssl_ca=f&ssl_key_password=secret",
            "mariadb://lab:***@server/rig1?ssl_ca=f",
        ),
        ("postgresql:///rig1?host=/run/pg&password=secret", "postgresql:///rig1?host=/run/pg&password=***"),
    ],
)
def test_a_servers_address_is_told_from_a_path_and_shown_without_its_password(url, shown):
    address = address_of(url)
    assert isinstance(address, ServerAddress)
    assert str(address).startswith(shown)
    assert "ret" not in f"{address} {address!r} {[address]}"
    assert "ret" not in masked(f"Unused Tokens: ['{url}'].")
    assert address_of(address) is address


@pytest.mark.parametrize("path", ["arm.db", "a/b.db", Path("postgresql.db"), "a//b"])
def test_what_is_no_address_of_a_server_is_a_path(path):
    assert address_of(path) == Path(path)


@pytest.mark.parametrize(
    "url",
    [
        "oracle://lab:secret@server/rig1",
        "postgresql://lab:secret@server",
        "postgresql://lab:sec/ret@server/rig1",
        "postgresql://lab:secret@server:port/rig1",
        "postgresql:/lab:secret@server/rig1",
        Path("mysql://lab:secret@server/rig1"),
    ],
)
def test_half_an_address_is_refused_without_showing_what_may_be_a_password(url):
    with pytest.raises(UnusableInput, match="expected postgresql://user@host/database") as refused:
        Store.open(url)
    assert "ret" not in str(refused.value)


def test_a_library_that_is_not_installed_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pymysql", None)
    with pytest.raises(
        UnusableInput, match=r"rig1: a store on a server needs pymysql: pip install 'pneumarm\[server"
    ):
        Store.open("mysql://lab@server/rig1")


# ---- one writer


def test_a_second_writer_is_refused_by_name_and_readers_are_not(served):
    address = served.new()
    with Store.for_arm(address, ArmSpec()) as store:
        store.append(make_recorded(1))
        with pytest.raises(
            UnusableInput, match=f"process {os.getpid()} on {socket.gethostname()} is writing to it; wait for it"
        ):
            Store.append_to(address)
        with Store.for_arm(served.new(), ArmSpec()) as other:  # a database beside it
            other.append(make_recorded(1))
        with Store.open(address) as reader:
            assert reader.sequences == 1
            with pytest.raises(PneumarmError, match="opened for reading"):
                reader.append(make_recorded(2))
    with Store.append_to(address) as store:
        assert store.append(make_recorded(2)) == 2


WRITER = """
import sys
from pneumarm.transitions import Store
from stand_ins import make_recorded
with Store.append_to(sys.argv[1]) as store:
    while True:
        number = store.sequences + 1
        print(store.append(make_recorded(number), {"arm": b"%d" % number}), flush=True)
"""


def test_a_writer_that_is_killed_loses_nothing_acknowledged_and_lets_go_of_the_lock(served):
    address = served.new()
    Store.create(address, ArmSpec()).close()
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    for kill in range(2):
        with child(sys.executable, "-c", WRITER, address, env=environment) as writer:
            said = [writer.stdout.readline() for _ in range(3 + 4 * kill)]
            rest, errors = end(writer, signal.SIGKILL)
        assert not errors
        numbers = [int(one) for one in "".join([*said, rest]).split()]
        with Store.append_to(address) as store:
            assert store.sequences >= numbers[-1]
            assert store.state() == b"%d" % store.sequences
            numbered(store)
            store.check()


def test_a_reader_sees_whole_sequences_only(served):
    address = served.new()
    with Store.create(address, ArmSpec()) as store, Store.open(address) as reader:
        store.append(make_recorded(1))
        with store.writing():
            store.append(make_recorded(2))
            assert (store.sequences, reader.sequences) == (2, 1)
            assert sum(len(block) for block in reader) == 21
        assert sum(len(block) for block in reader) == 42
        with reader.snapshot():
            assert reader.sequences == 2
            store.append(make_recorded(3))
            assert reader.sequences == 2
        assert reader.sequences == 3


# ---- what goes wrong


def test_a_connection_that_is_lost_while_collecting_is_told_and_the_same_call_goes_on(served, tmp_path):
    address, arm = served.new(), FirstOrderArm()

    def stop(done, total):
        if done >= 300:
            served.stop()

    with Store.for_arm(address, arm.spec) as store:
        try:
            with pytest.raises(PneumarmError, match="connection to the server was lost") as lost:
                collect(arm, store, 2000, settings=SHORT, progress=stop)
            assert arm.closed
            assert lost.value.exit_code == 1
            assert "what was acknowledged is safe: run the same command again" in str(lost.value)
            assert "\n" not in str(lost.value)
            with pytest.raises(UnusableInput, match="cannot be opened"):
                Store.append_to(address)
        finally:
            served.start()
        with pytest.raises(PneumarmError, match="was lost"):  # and no other session in its place
            store.append(make_recorded(1))
    with Store.for_arm(address, arm.spec) as store:
        assert store.transitions == 300
        collect(FirstOrderArm(), store, 2000, settings=SHORT)
    uninterrupted = FirstOrderArm()
    with Store.create(tmp_path / "s.db", arm.spec) as store:
        collect(uninterrupted, store, 2000, settings=SHORT)
    for one, other in zip(content(address)[2:4], content(tmp_path / "s.db")[2:4], strict=True):
        np.testing.assert_equal(one, other)


def test_what_the_server_refuses_is_told_in_a_line_without_the_password(served, monkeypatch):
    address = served.new()
    name = re.search(r"rig\d+", address)[0]
    wrong = address.replace("lab:", "lab:not")
    port = re.sub(r"@.*?/", "@127.0.0.1:1/", address).partition("?")[0]
    host = re.sub(r"@.*?/", "@there.invalid/", address).partition("?")[0]
    missing = address.replace(f"/{name}", "/none") if "mysql" in address else address.replace("/lab?", "/none?")
    unknown = address + ("&" if "?" in address else "?") + "colour=red"
    for one in (wrong, port, host, missing, unknown):
        with pytest.raises(
            UnusableInput, match=r"cannot be opened \(.{10,}\); expected a server that runs"
        ) as refused:
            Store.open(one)
        shown = str(refused.value)
        assert "\n" not in shown
        assert PASSWORD not in shown
        assert PASSWORD not in repr(refused.value.__cause__)
    with pytest.raises(UnusableInput, match=r"expected a store written by .* this database is empty"):
        Store.open(address)
    with pytest.raises(UnusableInput, match="this database is empty"):
        Store.append_to(address)


def test_the_environments_password_is_used(mysql, monkeypatch):
    address = mysql.new(password=None)
    with pytest.raises(UnusableInput, match="Access denied"):
        Store.open(address)
    monkeypatch.setenv("MYSQL_PWD", PASSWORD)
    Store.create(address, ArmSpec()).close()


def test_a_password_of_postgresqls_environment_is_used(postgresql, monkeypatch):
    address = postgresql.new(password=None)
    with pytest.raises(UnusableInput, match="no password supplied"):
        Store.open(address)
    monkeypatch.setenv("PGPASSWORD", PASSWORD)
    Store.create(address, ArmSpec()).close()


def test_a_database_of_somebody_elses_is_refused_and_left_as_it_is(served):
    for table in ("flights (number INT)", "store (shelf INT)", "store (name VARCHAR(100), value VARCHAR(100))"):
        address = served.new()
        where = re.search(r"rig\d+", address)[0]
        served.execute(f'CREATE TABLE "{where}".{table}', address)
        filled = "VALUES (1)" if "INT" in table else "VALUES ('spec', '{}'), ('shelf', 'left')"
        served.execute(f'INSERT INTO "{where}".{table.split()[0]} {filled}', address)
        if "postgresql" in address:
            served.execute(f"GRANT ALL ON ALL TABLES IN SCHEMA {where} TO lab", address)
        for opening in (
            Store.open,
            Store.append_to,
            lambda address: Store.for_arm(address, ArmSpec()),
            lambda address: Store.create(address, ArmSpec()),
        ):
            with pytest.raises(UnusableInput, match=r"other tables \(\w+\)"):
                opening(address)
        assert served.execute(f'SELECT * FROM "{where}".{table.split()[0]}', address)


def test_missing_rights_are_told(served):
    address = served.new()
    where = re.search(r"rig\d+", address)[0]
    for statement in served.look_only(where):
        served.execute(statement, address)
    with pytest.raises(UnusableInput, match=r"its user lacks rights .* grant all of them"):
        Store.create(address, ArmSpec())


def test_a_mysql_that_may_lose_what_it_acknowledged_gets_no_writer(mysql):
    address = mysql.new()
    Store.create(address, ArmSpec()).close()
    mysql.execute("SET GLOBAL innodb_flush_log_at_trx_commit = 2")
    try:
        with pytest.raises(UnusableInput, match=r"its innodb_flush_log_at_trx_commit is 2; set .* = 1 on it"):
            Store.append_to(address)
        Store.open(address).close()
    finally:
        mysql.execute("SET GLOBAL innodb_flush_log_at_trx_commit = 1")


def test_postgresql_syncs_what_a_writer_commits(postgresql):
    address = postgresql.new()
    Store.create(address, ArmSpec()).close()
    postgresql.execute("ALTER ROLE lab SET synchronous_commit = off")
    try:
        with Store.append_to(address) as store:
            assert store._one("SHOW synchronous_commit") == "on"
        with Store.open(address) as store:
            assert store._one("SHOW synchronous_commit") == "off"
    finally:
        postgresql.execute("ALTER ROLE lab RESET synchronous_commit")


def test_a_whole_database_of_postgresql_is_a_store_too(postgresql):
    postgresql.execute("CREATE DATABASE whole OWNER lab")
    with Store.for_arm(postgresql.database("whole"), ArmSpec()) as store:
        store.append(make_recorded(1))
    with Store.for_arm(postgresql.database("whole"), ArmSpec()) as store:
        assert store.sequences == 1
    with pytest.raises(UnusableInput, match="search_path names no schema that there is"):
        Store.create(postgresql.database("whole") + "&options=-csearch_path%3Dnone", ArmSpec())


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        ("UPDATE store SET value = '99' WHERE name = 'version'", "a store of version 99"),
        ('ALTER TABLE "rows" ADD more INT', "its tables are not those"),
        ('DELETE FROM "rows" WHERE sequence = 20 AND step = 20', "rows are missing"),
        ('UPDATE "rows" SET joint_1_command_2 = 1.5 WHERE sequence = 2 AND step = 5', "impossible values"),
    ],
)
def test_altered_stores_are_refused(served, statement, message):
    address = served.new()
    with Store.create(address, ArmSpec()) as store:
        store.append_all(make_recorded(i + 1) for i in range(20))
    served.execute(statement, address)
    with pytest.raises(UnusableInput, match=message), Store.open(address) as store:
        store.check()


# ---- copies


def original(path):
    """Make a store of all that one can hold, with numbers of every kind."""
    spec = ArmSpec(joints=2, velocity_sensor=True)
    with Store.create(path, spec, valves=False) as store:
        store.append(measured(0, spec))
        store.begin_run("collect", {"words": "ü\u2028'\"%:x\\", "share": 0.1})
        for number in range(1, 5):
            kind = "velocity" if number % 2 else "Velocity"
            store.append(measured(number, spec, kind, info={"goal": [0.1 + 0.2]}), {"arm": os.urandom(3000), "": b""})
        store.mark(2, [Mark(3, 5, "50 % of 'it' :x"), Mark(0, 1, "ä")])
    return path


def measured(number, spec, kind="velocity", **options):
    command = np.random.default_rng(number).normal(size=(21, 2, 2))
    command[:4] = np.array([-0.0, 5e-324, 1.7976931348623157e308, 0.1 + 0.2])[:, None, None]
    command[-1] = np.nan
    velocity = {name: np.linspace(-1, 1, 21) / 3 for name in spec.further}
    return make_recorded(number, joints=2, command=command, measured=velocity, kind=kind, **options)


def test_a_copy_equals_the_original_there_and_back(served, tmp_path):
    path, back, address = original(tmp_path / "a.db"), tmp_path / "back.db", served.new()
    result = copy_store(path, address)
    assert (result.sequences, result.rows, result.runs) == (5, 105, 1)
    assert_same(path, address)
    copy_store(address, back)
    assert_same(path, back)
    with Store.open(path) as one, Store.open(back) as other:
        assert one.state("") == other.state("") == b""
        assert other.marked_rows(1) == one.marked_rows(1) == {"50 % of 'it' :x": 3, "ä": 2}
        other.check()
    for there in (address, back):
        with pytest.raises(UnusableInput, match="exists already"):
            copy_store(path, there)
    with Store.append_to(address) as store:  # and it goes on as the original would
        assert store.begin_run("collect", {}) == 2
        assert store.append(measured(6, store.spec)) == 6


def test_what_cannot_be_copied_whole_leaves_nothing(served, tmp_path):
    path, address = original(tmp_path / "a.db"), served.new()
    with Store.append_to(path) as store:
        store.database.execute('UPDATE "rows" SET time = -1 WHERE sequence = 5 AND step = 20')
    for target in (address, tmp_path / "copy.db"):
        with pytest.raises(UnusableInput, match="impossible values"):
            copy_store(path, target)
    assert not list(tmp_path.glob("*copy*"))
    with pytest.raises(UnusableInput, match="this database is empty"):
        Store.open(address)
    Store.create(address, ArmSpec()).close()  # as a copy leaves it that is killed in the middle
    with suppress(UnusableInput):
        copy_store(path, address)
    assert copy_store(original(tmp_path / "b.db"), address).sequences == 5


def test_a_store_is_copied_as_it_is_when_copying_begins(served, tmp_path, monkeypatch):
    address = served.new()
    with Store.create(address, ArmSpec()) as store:
        store.append_all(make_recorded(i + 1) for i in range(3))
        whole = Store.made_whole

        def grown(*arguments):
            store.append(make_recorded(4), {"arm": b"four"})
            return whole(*arguments)

        monkeypatch.setattr(Store, "made_whole", grown)
        with Store.open(address) as reader, reader.snapshot():
            assert reader.sequences == 3
        assert copy_store(address, tmp_path / "copy.db").sequences in (3, 4)
    with Store.open(tmp_path / "copy.db") as copy:
        assert copy.state() == (b"four" if copy.sequences == 4 else None)
        numbered(copy)


# ---- by command line


def said(capsys, *arguments):
    """Return what a command says; it ends well."""
    with pytest.raises(SystemExit) as ended:
        cli.main([*map(str, arguments), "--json"])
    output, errors = capsys.readouterr()
    assert PASSWORD not in output + errors
    assert ended.value.code == 0, errors
    return output


def test_a_laboratory_works_on_a_server_by_command_line(served, capsys, tmp_path):
    address, again = served.new(), served.new()
    for transitions in (2000, 2200):  # the second call goes on
        said(capsys, "collect", "virtual:seed=3", address, "--transitions", transitions)
    said(capsys, "collect", "virtual:seed=3", tmp_path / "arm.db", "--transitions", 2200)
    np.testing.assert_equal(content(address)[2:4], content(tmp_path / "arm.db")[2:4])
    said(capsys, "copy", address, tmp_path / "copy.db")
    assert_same(address, tmp_path / "copy.db")
    assert '"relative_error"' in said(capsys, "fit", address, "--out", tmp_path / "arm.sim", "--epochs", 3)
    assert '"cells"' in said(capsys, "coverage", address)
    said(capsys, "export", address, "--out", tmp_path / "arm.csv")
    said(capsys, "import", tmp_path / "arm.csv", again)
    np.testing.assert_equal(content(address)[2][0][2:6], content(again)[2][0][2:6])


@pytest.mark.parametrize(
    "wrong", [("coverage", "more"), ("fit", "--out", "x", "--colour"), ("export", "--out", "x.onnx")]
)
def test_no_command_shows_a_password_that_it_complains_of(wrong, capsys, served):
    with pytest.raises(SystemExit) as ended:
        cli.main([wrong[0], served.new(), *wrong[1:]])
    output, errors = capsys.readouterr()
    assert ended.value.code == 2
    assert errors.count("\n") == 1
    assert "s3cr" not in output + errors
    with pytest.raises(SystemExit):
        cli.main([wrong[0], *wrong[1:], served.new()])
    assert "s3cr" not in "".join(capsys.readouterr())
