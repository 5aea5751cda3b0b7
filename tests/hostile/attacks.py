"""The attacks: by kind of file and kind of damage, the command lines that are run on it.

A group is called with the folder of sound files and yields its cases; what a case damages is made when it is run.
"""

import json
import os
import random
import re
import shutil
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from itertools import cycle
from pathlib import Path
from typing import Any

from tests.hostile.commands import ANY, ARM, DONE_OR_REFUSED, REFUSED, Case
from tests.hostile.damage import (
    Statement,
    alter,
    cuts,
    false_headers,
    false_metadata,
    false_settings,
    false_weights,
    flipped,
    replaced,
    safetensors,
    spoilt_pages,
    taken_apart,
    tensors_of,
    with_nan,
)

Group = Callable[[Path], Iterator[Case]]
Data = bytes | str | Callable[[], bytes | str]
"""What is written into a file; a function makes what takes much memory."""
GROUPS: dict[tuple[str, str], Group] = {}
"""All attacks by kind of file and kind of damage."""

RUN = (
    "run", "--arm", ARM, "--seed", "5", "--transitions", "2000", "--bound-episodes", "0", "--test-episodes", "20",
    "--fit.epochs", "10", "--servo.updates", "20", "--transfer.episodes", "2", "--transfer.test-episodes", "2",
    "--moving.goals", "4", "--moving.frequencies", "1", "--moving.seconds", "2",
)  # fmt: skip
"""The run whose files are damaged."""


def group(kind: str, damage: str) -> Callable[[Group], Group]:
    """Enter a group of cases under the kind of file and the kind of damage."""

    def enter(cases: Group) -> Group:
        GROUPS[kind, damage] = cases
        return cases

    return enter


def writing(name: str, data: Data) -> Callable[[Path], object]:
    """Return what writes a file of the folder."""

    def write(folder: Path) -> None:
        made = data() if callable(data) else data
        (folder / name).write_bytes(made.encode() if isinstance(made, str) else made)

    return write


def files(
    group: str, commands: dict[str, tuple[str, ...]], made: Iterable[tuple[str, Any]], codes: tuple[int, ...]
) -> Iterator[Case]:
    """Yield a case of each command for each file made; the command names it, damaged.agent for example."""
    for what, data in made:
        for name, command in commands.items():
            damaged = re.search(r"damaged\.\w+", " ".join(command))
            assert damaged is not None
            yield Case(f"{group}, {what}, {name}", command, writing(damaged[0], data), codes)


MOVE = {"move": ("move", "damaged.agent", "--arm", ARM, "10deg")}
AGENT = MOVE | {"export": ("export", "damaged.agent", "--out", "new.c")}
SIMULATION = {
    "test": ("test", "arm.agent", "damaged.sim", "arm.db", "--episodes", "20"),
    "plan": ("move", "plan:damaged.sim", "--arm", ARM, "10deg"),
    "as an arm": ("arm", "sensors", "simulation:damaged.sim", "--seconds", "0.2"),
}
TENSORS = {"agent": (AGENT, "arm.agent"), "simulation": (SIMULATION, "arm.sim")}


def _tensors(kind: str) -> None:
    commands, name = TENSORS[kind]
    rotating = cycle(commands)

    def one() -> dict[str, tuple[str, ...]]:
        chosen = next(rotating)
        return {chosen: commands[chosen]}

    @group(kind, "cut")
    def cut(sound: Path) -> Iterator[Case]:
        data = (sound / name).read_bytes()
        yield from files(kind, commands, cuts(data), REFUSED)
        yield from files(kind, commands, [("longer", data + b"x" * 100)], DONE_OR_REFUSED)

    @group(kind, "header")
    def header(sound: Path) -> Iterator[Case]:
        yield from files(kind, commands, false_headers((sound / name).read_bytes()), REFUSED)

    @group(kind, "metadata")
    def metadata(sound: Path) -> Iterator[Case]:
        yield from files(kind, commands, false_metadata((sound / name).read_bytes()), REFUSED)

    @group(kind, "settings")
    def settings(sound: Path) -> Iterator[Case]:
        for made in false_settings((sound / name).read_bytes(), each=4):
            yield from files(kind, one(), [made], ANY)

    @group(kind, "weights")
    def weights(sound: Path) -> Iterator[Case]:
        data = (sound / name).read_bytes()
        yield from files(kind, commands, [("no numbers", with_nan(data))], REFUSED)
        yield from files(kind, commands, [("huge", false_weights(data, 3e38))], ANY)

    @group(kind, "bytes")
    def flips(sound: Path) -> Iterator[Case]:
        data = (sound / name).read_bytes()
        yield from files(kind, commands, [(f"flipped {n}", flipped(data, n)) for n in range(12)], ANY)


for _kind in TENSORS:
    _tensors(_kind)


# Stores
DB = "damaged.db"
READ = {
    "coverage": ("coverage", DB),
    "export": ("export", DB, "--out", "new.csv"),
    "view": ("view", DB, "--out", "new.svg"),
    "test": ("test", "arm.agent", "arm.sim", DB, "--episodes", "20"),
}
READ_RARELY = {
    "copy": ("copy", DB, "new.db"),
    "collect": ("collect", ARM, DB, "--transitions", "2100"),
    "analyse": ("analyse", DB, "arm.sim", "--out", "new"),
    "fit": ("fit", DB, "--out", "new.sim", "--epochs", "1", "--ahead", "0"),
}
ROW = "UPDATE rows SET {} WHERE step = 3"


def repeated(statement: str, rows: Iterable[tuple[Any, ...]]) -> Statement:
    """Return what does a statement once for each of the rows."""
    return lambda connection: connection.executemany(statement, rows)


def schema(change: str) -> tuple[str, str]:
    """Return statements that change what the file says its tables are."""
    return "PRAGMA writable_schema = ON", f"UPDATE sqlite_master SET {change} WHERE name = 'rows'"


STORES: dict[str, dict[str, tuple[Statement, ...]]] = {
    "tables": {
        "none of rows": ("DROP TABLE rows",),
        "one more": ("CREATE TABLE x (y)",),
        "rows as a view": ("ALTER TABLE rows RENAME TO other", "CREATE VIEW rows AS SELECT * FROM other"),
        "a trigger": ("CREATE TRIGGER t AFTER INSERT ON sequences BEGIN DELETE FROM rows; END",),
        "an index": ("CREATE INDEX i ON sequences(kind)",),
        "user_version 99": ("PRAGMA user_version = 99",),
        "user_version 1": ("PRAGMA user_version = 1",),
        "application_id 5": ("PRAGMA application_id = 5",),
        "generated": schema("sql = 'CREATE TABLE rows(x, y GENERATED ALWAYS AS (randomblob(1e9)))'"),
        "virtual": schema("sql = 'CREATE VIRTUAL TABLE rows USING fts5(x)', rootpage = 0"),
        "page 1": schema("rootpage = 1"),
        "page 99999": schema("rootpage = 99999"),
    },
    "rows": {
        "angle text": (ROW.format("joint_1_angle = 'x'"),),
        "angle infinite": (ROW.format("joint_1_angle = 9e999"),),
        "angle a blob": (ROW.format("joint_1_angle = x'00ff'"),),
        "angle 20 MB": (ROW.format("joint_1_angle = zeroblob(20000000)") + " AND sequence = 1",),
        "angles huge": ("UPDATE rows SET joint_1_angle = 1e308 WHERE step % 2 = 1",),
        "times negative": ("UPDATE rows SET time = -time",),
        "times alike": ("UPDATE rows SET time = 0",),
        "times huge": ("UPDATE rows SET time = 1e300 WHERE step > 3",),
        "steps with a gap": ("UPDATE rows SET step = step + 1000000 WHERE step > 5",),
        "steps negative": ("UPDATE rows SET step = -step - 1",),
        "a step huge": (ROW.format("step = 9223372036854775807"),),
        "a command of 5": (ROW.format("joint_1_command_1 = 5"),),
        "commands infinite": ("UPDATE rows SET joint_1_command_1 = -9e999",),
        "commands null": ("UPDATE rows SET joint_1_command_1 = NULL",),
        "none": ("DELETE FROM rows",),
        "none, nor sequences": ("DELETE FROM rows", "DELETE FROM sequences"),
    },
    "sequences": {
        "numbers negative": ("UPDATE sequences SET number = -number",),
        "rows huge": ("UPDATE sequences SET rows = 9223372036854775807",),
        "rows text": ("UPDATE sequences SET rows = 'many'",),
        "transitions huge": ("UPDATE sequences SET transitions = 9223372036854775807",),
        "info cut": ("UPDATE sequences SET info = '{'",),
        "info a list": ("UPDATE sequences SET info = '[1]'",),
        "info deep": (("UPDATE sequences SET info = ?", ("[" * 30_000,)),),
        "kind HTML": ("UPDATE sequences SET kind = '<script>alert(1)</script>'",),
        "kind long": (("UPDATE sequences SET kind = ?", ("k" * 3_000_000,)),),
        "none": ("DELETE FROM sequences",),
        "every second": ("DELETE FROM sequences WHERE number % 2 = 0",),
    },
    "notes": {
        "metadata cut": ("UPDATE runs SET metadata = '{'",),
        "metadata a list": ("UPDATE runs SET metadata = '[]'",),
        "metadata null": ("UPDATE runs SET metadata = 'null'",),
        "metadata 15 MB": (("UPDATE runs SET metadata = ?", ('{"a":"' + "x" * 15_000_000 + '"}',)),),
        "runs without end": (repeated("INSERT INTO runs VALUES (?, 'p', '{}')", ((n,) for n in range(10, 100_000))),),
        "mark backwards": ("INSERT INTO marks VALUES (1, 5, 2, 'x')",),
        "mark huge": ("INSERT INTO marks VALUES (1, -9223372036854775808, 9223372036854775807, 'x')",),
        "mark text": ("INSERT INTO marks VALUES (1, 'a', 'b', 'x')",),
        "mark HTML": ("INSERT INTO marks VALUES (1, 1, 2, '<img src=x onerror=alert(1)>')",),
        "marks without end": (
            repeated("INSERT INTO marks VALUES (1, ?, ?, 'x')", [(n % 100, n % 100) for n in range(300_000)]),
        ),
        "state a pickle": ("INSERT OR REPLACE INTO state VALUES ('arm', x'80049563')",),
        "state 15 MB": ("INSERT OR REPLACE INTO state VALUES ('arm', zeroblob(15000000))",),
        "no state": ("DELETE FROM state",),
        "no arm": ("DELETE FROM store",),
        "no text": ("UPDATE store SET value = CAST(x'ff' AS TEXT)",),
    },
}


def store_cases(kind: str, what: str, commands: dict[str, tuple[str, ...]], *statements: Statement) -> Iterator[Case]:
    """Yield a case of each command for a store with these changes."""

    def damage(folder: Path) -> None:
        shutil.copy(folder / "arm.db", folder / DB)
        alter(folder / DB, *statements)

    for name, command in commands.items():
        yield Case(f"store, {kind}, {what}, {name}", command, damage, DONE_OR_REFUSED)


def _stores(kind: str) -> None:
    rarely = cycle(READ_RARELY)

    @group("store", kind)
    def altered(sound: Path) -> Iterator[Case]:
        for what, statements in STORES[kind].items():
            name = next(rarely)
            yield from store_cases(kind, what, READ | {name: READ_RARELY[name]}, *statements)


for _kind in STORES:
    _stores(_kind)


@group("store", "arm")
def store_arms(sound: Path) -> Iterator[Case]:
    with closing(sqlite3.connect(f"file:{sound / 'arm.db'}?mode=ro", uri=True)) as store:
        known = dict(store.execute("SELECT name, value FROM store"))
    rng, rotating = random.Random(5), cycle((READ | READ_RARELY).items())
    texts = ("", "null", "[]", "{}", "5", "x" * 1_000_000, "[" * 50_000, "1e999", '"<script>"')
    changes = [(name, text[:10], text) for name in known for text in texts]
    spec = json.loads(known["spec"])
    for key in spec:
        for value in rng.sample([None, -1, 0, 1e308, 10**30, "x", [], {}, True, 64, 10**9], 3):
            changes.append(("spec", f"{key} = {value}", json.dumps(spec | {key: value})))
    for name, what, text in changes:
        chosen = dict([next(rotating)])
        yield from store_cases(name, what, chosen, ("UPDATE store SET value = ? WHERE name = ?", (text, name)))


@group("store", "pages")
def store_pages(sound: Path) -> Iterator[Case]:
    rotating = cycle((READ | READ_RARELY).items())
    for number in range(72):

        def damage(folder: Path, number: int = number) -> None:
            data = (folder / "arm.db").read_bytes()
            (folder / DB).write_bytes(spoilt_pages(data, number))
            if number % 10 == 9:
                (folder / f"{DB}-wal").write_bytes(random.Random(number).randbytes(50_000))

        name, command = next(rotating)
        yield Case(f"store, pages, {number}, {name}", command, damage, DONE_OR_REFUSED)


# TOML
TOML: dict[str, Data] = {
    "deep": "a = " + "[" * 60_000,
    "deep key": ".".join(["a"] * 60_000) + " = 1",
    "deep table": "[" + ".".join(["a"] * 20_000) + "]\nx = 1",
    "deep inline table": "x = {" + "a={" * 20_000,
    "30 MB": lambda: "x = '" + "y" * 30_000_000 + "'",
    "many keys": lambda: "\n".join(f"k{n} = {n}" for n in range(400_000)),
    "zeros": "\0" * 1_000,
    "no key": "5f3a" * 2_500 + "=",
    "number of 5,000 digits": "[spec]\njoints = " + "9" * 5_000,
    "Latin 1": "x = 'é'".encode("latin1"),
    "dates": "[spec]\nname = 1979-05-27\njoints = 1979-05-27T07:32:00Z",
}
SPEC = ("arm", "sensors", f"{ARM},spec=damaged.toml", "--seconds", "0.1")
FAULTS = ("arm", "sensors", f"{ARM},faults=damaged.toml", "--seconds", "0.1")


@group("TOML", "anything")
def toml(sound: Path) -> Iterator[Case]:
    commands = {
        "spec": SPEC,
        "faults": FAULTS,
        "config": ("collect", ARM, "new.db", "--transitions", "2000", "--config", "damaged.toml"),
        "mapping": ("import", "arm.csv", "new.db", "--mapping", "damaged.toml"),
        "design": ("taguchi", "analyse", "arm.csv", "--goal", "larger", "--design", "damaged.toml", "--out", "new"),
    }
    yield from files("TOML", commands, TOML.items(), REFUSED)
    for name, command in commands.items():
        codes = REFUSED if name in ("mapping", "design") else DONE_OR_REFUSED
        yield Case(f"TOML, empty, {name}", command, writing("damaged.toml", ""), codes)


SPECS = {
    "joints": ("1000000000", "-1", "0", "64", "true", "1.0", "'x'"),
    "period": ("1e-300", "-1", "nan", "inf", "1e300"),
    "counts_per_degree": ("0", "nan", "1e-320", "-5"),
    "angle_range": ("[]", "[1023.0, 0.0]", "[nan, 1]", "[0.0, 1e308]", "[0, 0]"),
    "max_pressure": ("1e308", "inf", "-1", "nan", "true"),
    "max_inflation": ("inf", "1e308", "-1", "nan"),
    "latency": ("1e9", "-1", "nan"),
    "name": ('"<script>alert(1)</script>"', '"\\u001b[2J\\n\\r"', f'"{"n" * 1_000_000}"', '""'),
    "links": ("[nan]", "[-1]", "[1e308]"),
    "pressure_gain": ("[[0, 0]]", "[[nan, 1]]", "[[1e308, -1e308]]", "[]", "[[1.0]]"),
    "shortest_pulse": ("5", "nan", "-1"),
    "leak": ("[[nan, 1]]", "'x'", "[[1e308, 1e308]]"),
}


@group("TOML", "values")
def toml_values(sound: Path) -> Iterator[Case]:
    lines = (sound / "arm.toml").read_text().splitlines()
    for key, values in SPECS.items():
        assert any(line.startswith(f"{key} = ") for line in lines), key
        for value in values:
            other = "\n".join(f"{key} = {value}" if line.startswith(f"{key} = ") else line for line in lines)
            yield from files("arm.toml", {f"{key} = {value[:20]}": SPEC}, [("value", other)], DONE_OR_REFUSED)


@group("TOML", "faults")
def toml_faults(sound: Path) -> Iterator[Case]:
    leak = '[[fault]]\nkind = "leak"\nmuscle = 1\n'
    made = {
        "no number": f"{leak}begin = nan\nfactor = 3",
        "infinite": f"{leak}begin = 0\nfactor = inf",
        "joint 9": f"{leak}begin = 0\nfactor = 3\njoint = 9",
        "20,000": '[[fault]]\nkind = "sensor-noise"\nbegin = 0\n' * 20_000,
    }
    yield from files("faults", {"sensors": FAULTS}, made.items(), DONE_OR_REFUSED)


# Tables
def tables(sound: Path) -> dict[str, Data]:
    """Return tables of readings of all bad kinds."""
    text = (sound / "arm.csv").read_text()
    head, row, other = text.splitlines()[:3]
    cells = row.split(",")

    def cell(value: str, place: int = 2) -> str:
        return f"{head}\n{','.join([*cells[:place], value, *cells[place + 1 :]])}"

    return {
        "a million columns": lambda: ",".join(f"c{n}" for n in range(10**6)) + "\n" + ",".join(["1"] * 10**6),
        "a wide row": head + "\n" + row + "," * 10**6,
        "a long row": lambda: head + "\n" + "1" * 50_000_000,
        "a long header": lambda: "x" * 50_000_000,
        "an open quote": lambda: head + '\n"' + "a" * 20_000_000,
        "spaces": lambda: head + "\n" + " " * 40_000_000,
        "a zero": cell("\0"),
        "nan": cell("nan"),
        "inf": cell("inf"),
        "1e400": cell("1e400"),
        "hexadecimal": cell("0x1"),
        "underscores": cell("6_1_6"),
        "other digits": cell("٦١٦"),
        "10,000 digits": cell("9" * 10_000),
        "100,000 letters": cell("x" * 100_000),
        "a formula": cell('=cmd|"/C calc"!A0'),
        "sequence huge": cell("9" * 20, 0),
        "sequence negative": cell("-1", 0),
        "commands of 7": "\n".join((head, row, ",".join([*other.split(",")[:-2], "7", "-7"]))),
        "time leaps": "\n".join((head, row, ",".join([cells[0], "1e15", *cells[2:]]))),
        "times back": "\n".join([head, *reversed(text.splitlines()[1:50])]),
        "empty": "",
        "header only": head,
        "a column twice": f"{head.replace('joint_1_pressure_2', 'joint_1_angle')}\n{row}",
        "byte order mark": "\ufeff" + text[: text.rindex("\n", 0, 20_000)],
        "CR LF": text[: text.rindex("\n", 0, 20_000)].replace("\n", "\r\n"),
        "CR": text[: text.rindex("\n", 0, 20_000)].replace("\n", "\r"),
        "UTF-16": text[:5_000].encode("utf-16"),
        "Latin 1": f"{head}\n{row}é".encode("latin1"),
        "ragged": f"{head}\n{row}\n1,2",
        "compressed": b"\x1f\x8b" + random.Random(1).randbytes(1_000),
    }


@group("table", "anything")
def hostile_tables(sound: Path) -> Iterator[Case]:
    commands = {
        "import": ("import", "damaged.csv", "new.db", "--mapping", "arm.csv.toml"),
        "reference": ("track", "arm.agent", "--arm", ARM, "--reference", "damaged.csv", "--seconds", "0.3"),
        "taguchi": ("taguchi", "analyse", "damaged.csv", "--goal", "larger", "--out", "new"),
    }
    for what, data in tables(sound).items():
        for name, command in commands.items():
            codes = DONE_OR_REFUSED if name == "import" else REFUSED
            yield from files("table", {name: command}, [(what, data)], codes)


@group("table", "references")
def references(sound: Path) -> Iterator[Case]:
    track = ("track", "arm.agent", "--arm", ARM, "--seconds", "0.3", "--reference")
    made = {
        "nan": "0,nan\n1,2",
        "times back": "0,1\n2,1\n1,1",
        "a time twice": "0,1\n0,2",
        "time negative": "-5,1\n5,2",
        "angles huge": "0,1e308\n1,-1e308",
        "1,500,000 rows": "\n".join(f"{n},{n % 20}" for n in range(1_500_000)),
        "time huge": "0,1\n1e300,2",
        "times tiny": "0,1\n5e-324,20\n1e-323,-20",
        "one number": "5",
        "words": "up\ndown",
    }
    yield from files("reference", {"track": (*track, "damaged.csv")}, made.items(), ANY)
    names = (
        "sine:0Hz,20deg", "sine:1e300Hz,20deg", "sine:nanHz,1deg", "sine:1Hz,1e308deg", "sine:-1Hz,5deg", "sine:",
        "ramp:1e308", "sine:1Hz,infdeg", "x" * 100_000, "sine:1Hz,5deg,5deg,5deg", "jerk:1", "/",
    )  # fmt: skip
    for name in names:
        yield Case(f"reference {name[:20]}", (*track, name), codes=ANY)


# What is given on the command line, and on standard input
@group("words", "goals")
def goals(sound: Path) -> Iterator[Case]:
    given = (
        "nandeg", "infdeg", "1e308deg", "-1e308", "1e400", "9" * 5_000, "0.1m,nanm", "1e308m,1m", "٣deg", "", " ",
        "1deg,2deg", "0x10", "1_0deg", "x" * 100_000,
    )  # fmt: skip
    move = ("move", "arm.agent", "--arm", ARM)
    for goal in given:
        yield Case(f"goal {goal[:20]!r}", (*move, "--", goal), codes=ANY)
        yield Case(f"goal read {goal[:20]!r}", (*move, "-"), codes=ANY, input=goal.encode() + b"\n")
    for name, data in {"noise": random.Random(2).randbytes(2_000), "a zero": b"\0\n"}.items():
        yield Case(f"goals read, {name}", (*move, "-"), input=data)


@group("words", "arms")
def arms(sound: Path) -> Iterator[Case]:
    given = (
        "virtual:seed=" + "9" * 5_000, "virtual:seed=-1", "virtual:joints=1000000000", "virtual:joints=0",
        f"{ARM},rate=1e300", f"{ARM},period=1e-300", f"{ARM},rate=1e-300", f"{ARM},rate=nan", "virtual:seed=²",
        "virtual:joints=٢", "virtual:joints=2,coupling=nan", "virtual:joints=2,coupling=1e308", "python:os:getcwd",
        "python:nope:x", "python:..os:x", "python::", "python:a:b:c", "emulated:emulated:virtual",
        "emulated:" * 500 + "virtual", "serial:", "serial:/dev/null", "serial:socket://127.0.0.1:1", "simulation:",
        "x" * 100_000, "", "virtual:sensors=" + "velocity+" * 10_000, f"{ARM},every=2", "virtual:preset=../../x",
    )  # fmt: skip
    for arm in given:
        codes = (1, 2) if arm.startswith(("serial", "python")) else DONE_OR_REFUSED
        yield Case(f"arm {arm[:30]!r}", ("arm", "sensors", arm, "--seconds", "0.1"), codes=codes)


# The folder of a run
def run_cases(name: str, change: Callable[[Path], object], *commands: str, codes: tuple[int, ...]) -> Iterator[Case]:
    """Yield a case for each of the commands on a folder of a run in which ``change`` has changed something."""

    def damage(folder: Path) -> None:
        shutil.copytree(folder / "run", folder / "damaged")
        (folder / "damaged" / "report.html").unlink()
        change(folder / "damaged")

    known = {
        "run": (*RUN, "--out", "damaged"),
        "report": ("report", "damaged"),
        "versions": ("versions", "damaged"),
        "move": ("move", "damaged", "--arm", ARM, "10deg"),
    }
    for command in commands:
        yield Case(f"run folder, {name}, {command}", known[command], damage, codes)


@group("run folder", "JSON")
def run_json(sound: Path) -> Iterator[Case]:
    texts = {
        "empty": "", "null": "null", "a list": "[]", "a number": "5", "cut": "{", "deep": "[" * 50_000,
        "a stage null": '{"collect": null}', "stages no tables": '{"collect": 5, "simulation": []}', "NaN": "NaN",
        "10,000 digits": '{"a": ' + "9" * 10_000 + "}", "20 MB": '"' + "x" * 20_000_000 + '"',
    }  # fmt: skip
    for file in ("results.json", "settings.json", "arm.json", "adaptation.json"):
        for number, (what, text) in enumerate(texts.items()):
            others = [("versions", "move"), ("report",)][number % 2]
            change = writing(file, text)
            yield from run_cases(f"{file} {what}", change, "run", *others, codes=ANY)


RECORDS = (
    "quality.safetensors", "moving.safetensors", "training_curves.safetensors", "coverage.safetensors",
    "test_episodes.safetensors", "demonstration-00.safetensors", "marked.safetensors",
)  # fmt: skip


@group("run folder", "records")
def run_records(sound: Path) -> Iterator[Case]:
    noise, rng = random.Random(4).randbytes(3_000), random.Random(5)
    for file in (*RECORDS, "episodes.csv", "recorded.svg"):
        data = (sound / "run" / file).read_bytes()
        other = (sound / "arm.agent").read_bytes()
        for what, made in {"empty": b"", "noise": noise, "an agent": other, "cut": data[:-7]}.items():
            yield from run_cases(f"{file} {what}", writing(file, made), "report", codes=DONE_OR_REFUSED)
        if file in RECORDS:
            for what, made in false_records(data, rng):
                yield from run_cases(f"{file} {what}", writing(file, made), "report", codes=DONE_OR_REFUSED)
    for text in ("5\n", "movement,reward\nx,y\n", "a" * 10_000_000):
        change = writing("episodes.csv", text)
        yield from run_cases(f"episodes.csv {text[:10]!r}", change, "report", codes=DONE_OR_REFUSED)


def false_records(data: bytes, rng: random.Random) -> Iterator[tuple[str, bytes]]:
    """Yield a record without one of its tensors, with it in other shapes, and without settings."""
    header, body = taken_apart(data)
    for change in ("gone", "in another shape", "flat"):
        name = rng.choice(tensors_of(header))
        size = 1
        for length in header[name]["shape"]:
            size *= length
        if change == "gone":
            made = {key: value for key, value in header.items() if key != name}
        else:
            made = header | {name: header[name] | {"shape": [size] if change == "flat" else [1, size]}}
        yield f"{name} {change}", safetensors(made, body)
    known = json.loads(header["__metadata__"]["pneumarm"])
    if "settings" in known:
        text = json.dumps(replaced(known, ("settings",), {}))
        yield "no settings", safetensors(header | {"__metadata__": {"pneumarm": text}}, body)


# Every kind of file in place of every other
PLACES: dict[str, tuple[tuple[str, ...], frozenset[str]]] = {
    "move": (("move", "FILE", "--arm", ARM, "10deg"), frozenset({"agent", "run"})),
    "transfer": (
        ("transfer", "FILE", "--arm", ARM, "--episodes", "5", "--test-episodes", "5", "--out", "new"),
        frozenset({"agent", "run", "simulation"}),  # a simulation that is planned in is an agent
    ),
    "test in": (("test", "arm.agent", "FILE", "arm.db", "--episodes", "10"), frozenset({"simulation"})),
    "test with": (("test", "arm.agent", "arm.sim", "FILE", "--episodes", "10"), frozenset({"store"})),
    "plan": (("move", "plan:FILE", "--arm", ARM, "10deg"), frozenset({"simulation"})),
    "simulation": (("arm", "sensors", "simulation:FILE", "--seconds", "0.1"), frozenset({"simulation"})),
    "coverage": (("coverage", "FILE"), frozenset({"store"})),
    "fit": (("fit", "FILE", "--out", "new.sim"), frozenset({"store"})),
    "analyse": (("analyse", "FILE", "arm.sim", "--out", "new"), frozenset({"store"})),
    "copy": (("copy", "FILE", "new.db"), frozenset({"store"})),
    "view": (("view", "FILE", "--out", "new.svg"), frozenset({"store", "run"})),
    "collect": (("collect", ARM, "FILE", "--transitions", "2100"), frozenset({"store", "missing"})),
    "export": (("export", "FILE", "--out", "new.csv"), frozenset({"agent", "store"})),
    "import": (("import", "FILE", "new.db"), frozenset({"CSV"})),
    "spec": (("arm", "sensors", f"{ARM},spec=FILE", "--seconds", "0.1"), frozenset({"TOML"})),
    "faults": (("arm", "sensors", f"{ARM},faults=FILE", "--seconds", "0.1"), frozenset({"TOML"})),
    "config": (("run", "--config", "FILE", "--out", "new"), frozenset()),
    "report": (("report", "FILE"), frozenset({"run"})),
    "versions": (("versions", "FILE"), frozenset({"run"})),
    "run": (("run", "--out", "FILE", "--arm", ARM, "--transitions", "2000"), frozenset({"missing"})),
    "reference": (
        ("track", "arm.agent", "--arm", ARM, "--reference", "FILE", "--seconds", "1"),
        frozenset({"CSV"}),
    ),
    "taguchi": (("taguchi", "analyse", "FILE", "--goal", "larger", "--out", "new"), frozenset()),
    "port": (("arm", "sensors", "serial:FILE", "--seconds", "0.1"), frozenset()),
}
"""Where a file is named on the command line, and the kinds that belong, or may belong, there."""
KINDS = {
    "agent": "arm.agent", "simulation": "arm.sim", "store": "arm.db", "CSV": "arm.csv", "TOML": "arm.toml",
    "run": "run", "page": "run/report.html", "results": "run/results.json", "missing": "nope", "null": "/dev/null",
    "zeros": "/dev/zero", "pipe": "pipe", "link to itself": "loop", "odd name": "a\nb\x1b[31m<b>.agent",
    "not readable": "secret.agent",
}  # fmt: skip
"""Kinds of files by their places."""


def odd_files(folder: Path) -> None:
    """Make what is neither a file nor a folder, and files with odd names or rights."""
    os.mkfifo(folder / "pipe")
    (folder / "loop").symlink_to("loop")
    shutil.copy(folder / "run" / "results.json", folder / KINDS["odd name"])
    shutil.copy(folder / "arm.agent", folder / "secret.agent")
    (folder / "secret.agent").chmod(0)


def _swapped(kind: str) -> None:
    @group("swapped", kind)
    def swapped(sound: Path) -> Iterator[Case]:
        if kind == "not readable" and os.getuid() == 0:
            return  # who may read everything
        for place, (command, right) in PLACES.items():
            if kind not in right:
                arguments = tuple(word.replace("FILE", KINDS[kind]) for word in command)
                codes = (1, 2) if place == "port" or kind == "not readable" else REFUSED
                yield Case(f"{kind} in place of what belongs there, {place}", arguments, odd_files, codes)


for _kind in KINDS:
    _swapped(_kind)
