"""What somebody else made is read, and refused where it is wrong, but never executed."""

import os
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from children import python
from pneumarm.arm import ArmSpec
from pneumarm.arm.spec_file import save_spec
from pneumarm.errors import UnusableInput
from pneumarm.experiments.row_file import read_trial_rows
from pneumarm.files import write_arrays, write_json, written_whole
from pneumarm.learning import METHODS, load_agent
from pneumarm.run import settings_in
from pneumarm.task.movements import Movements
from pneumarm.transitions import Store
from test_cli import Outcome

ARM = "virtual:seed=7"
CODE, METHOD = "python:stranger:arm", "stranger:MINE"


@pytest.fixture
def theirs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder in which every name that a file can hold is one of code, which could be imported from here."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    Path("stranger.py").write_text("open('it ran', 'w').close()\n")
    folder = tmp_path / "theirs"
    (folder / "all-goals").mkdir(parents=True)
    for name in ("agent", "adapted", "simulation", "training.checkpoint"):
        write_arrays(folder / f"{name}.safetensors", METHOD, {"method": METHOD}, {"x": np.zeros(1)})
    Store.create(folder / "transitions.db", ArmSpec(name=CODE)).close()
    save_spec(ArmSpec(name=CODE), folder / "arm.toml")
    for name in ("results", "adaptation", "all-goals/results", "all-goals/settings", "tuned"):
        write_json(folder / f"{name}.json", {"arm": CODE, "method": METHOD, "kind": METHOD, "experiment": METHOD})
    return folder


COMMANDS = {
    "live": "live THEIRS --port 0 --no-browser",
    "learned": "live THEIRS --arm ARM --port 0 --no-browser",
    "live agent": "live AGENT --port 0 --no-browser",
    "run": "run --out THEIRS",
    "report": "report THEIRS",
    "versions": "versions THEIRS",
    "put back": "versions THEIRS --to 0",
    "move": "move THEIRS --arm ARM 1deg",
    "tuned": "move THEIRS/tuned.json --arm ARM 1deg",
    "plan": "move plan:THEIRS/simulation.safetensors --arm ARM 1deg",
    "track": "track AGENT --arm ARM --reference ramp:1deg/s,1deg",
    "transfer": "transfer AGENT --arm ARM --out moved",
    "export": "export AGENT --out agent.c",
    "collect": "collect ARM new.db --controller AGENT",
    "view": "view THEIRS --out view.svg",
    "fit": "fit THEIRS/transitions.db --out sim",
    "coverage": "coverage THEIRS/transitions.db",
    "train": "train THEIRS/simulation.safetensors THEIRS/transitions.db --out trained",
    "arm": "arm sensors simulation:THEIRS/simulation.safetensors",
    "claims": "claims --out THEIRS",
}


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    "settings", [{"arm": CODE}, {"method": METHOD}, {"arm": f"emulated:{CODE}", "own": {"x": 1}}]
)
def test_no_command_runs_code_that_a_file_names(
    theirs: Path, capsys: pytest.CaptureFixture[str], command: str, settings: dict[str, object]
) -> None:
    write_json(theirs / "settings.json", settings)
    agent = theirs / "agent.safetensors"
    words = [
        word.replace("THEIRS", str(theirs)).replace("ARM", ARM).replace("AGENT", str(agent))
        for word in COMMANDS[command].split()
    ]
    done = Outcome(capsys, *words)
    assert done.code == 2, done.err
    assert "bug" not in done.err
    assert not Path("it ran").exists()


def test_a_file_of_an_arm_may_have_any_name(theirs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert Outcome(capsys, "arm", "sensors", f"{ARM},spec={theirs / 'arm.toml'}", "--seconds", "0.1").code == 0
    assert not Path("it ran").exists()


@pytest.mark.parametrize(("option", "name"), [("arm", CODE), ("method", METHOD)])
def test_what_the_user_names_again_is_taken_from_a_folder(theirs: Path, option: str, name: str) -> None:
    write_json(theirs / "settings.json", {option: name})
    with pytest.raises(UnusableInput, match=f"only you can: give --{option} {name} if you trust it"):
        settings_in(theirs)
    with pytest.raises(UnusableInput, match="only you can"):
        settings_in(theirs, ("python:another:arm", None))
    Path("stranger.py").write_text("from pneumarm.learning import METHODS\nMINE = METHODS['policy']\n")
    found = settings_in(theirs, (name,))
    assert found is not None
    assert getattr(found, option) == name


def test_names_in_agents_only_look_where_a_method_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    class Eager(type(os)):  # type: ignore[misc]
        def __getattr__(self, name: str) -> object:
            asked.append(name)
            raise AttributeError(name)

    loaded = Eager("eager")
    loaded.MINE = METHODS["policy"]
    monkeypatch.setitem(sys.modules, "eager", loaded)
    for kind, told in (
        ("eager:other", "only you can"),
        ("eager", "expected an agent"),
        ("os:system", "only you can"),
    ):
        write_arrays(tmp_path / "agent", kind, {}, {"x": np.zeros(1)})
        with pytest.raises(UnusableInput, match=told):
            load_agent(tmp_path / "agent")
    write_arrays(tmp_path / "agent", "eager:MINE", {}, {"x": np.zeros(1)})
    with pytest.raises(UnusableInput, match="expected a file of kind"):
        load_agent(tmp_path / "agent")
    assert asked == []


READERS: dict[str, Callable[[object], list[object]]] = {
    "config": lambda file: ["collect", ARM, "new.db", "--config", file],
    "faults": lambda file: ["arm", "sensors", f"{ARM},faults={file}"],
    "spec": lambda file: ["arm", "sensors", f"{ARM},spec={file}"],
    "mapping": lambda file: ["import", "r.csv", "new.db", "--mapping", file],
    "parquet": lambda file: ["import", file, "new.db", "--mapping", "m.toml"],
    "design": lambda file: ["taguchi", "analyse", "table.csv", "--design", file],
    "table": lambda file: ["taguchi", "analyse", file],
    "agent": lambda file: ["export", file, "--out", "agent.c"],
    "simulation": lambda file: ["arm", "sensors", f"simulation:{file}"],
    "store": lambda file: ["coverage", file],
    "trajectory": lambda file: ["collect", ARM, "new.db", "--controller", file],
}


@pytest.mark.parametrize("reader", READERS)
def test_pipes_devices_and_folders_are_no_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, reader: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.toml").write_text('[arm]\nperiod = 0.1\n[[joint]]\nangle = {column = "a", unit = "counts"}\n')
    Path("table.csv").write_text("trial,run 1\n1,2\n2,3\n")
    ending = {"parquet": ".parquet", "trajectory": ".csv"}.get(reader, ".x")
    pipe, device, folder = (Path(f"{name}{ending}") for name in ("pipe", "device", "folder"))
    os.mkfifo(pipe)
    device.symlink_to("/dev/zero")
    folder.mkdir()
    for path in (pipe, device, folder, Path("loop" + "x" * 300 + ending)):
        done = Outcome(capsys, *READERS[reader](path))
        assert done.is_refused(), done.err
        assert len(done.err) < 1500


@pytest.mark.parametrize(
    "text",
    [
        pytest.param(".".join(["a"] * 20_000) + " = 1", id="dots"),
        pytest.param("[" + " . ".join(["'a'"] * 20_000) + "]", id="table"),
        pytest.param("a = " + "[" * 60_000, id="brackets"),
        pytest.param("a = '" + "y" * 2_000_000 + "'", id="large"),
        pytest.param("a = " + "9" * 5000, id="digits"),
        pytest.param(r'a = "b\u0000"', id="zero"),
        pytest.param("x" * 100_000, id="word"),
    ],
)
def test_toml_that_would_take_long_is_refused_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str
) -> None:
    file = tmp_path / "options.toml"
    file.write_text(text)
    for reader in ("config", "faults", "spec", "mapping"):
        done = Outcome(capsys, *READERS[reader](file))
        assert done.is_refused("options.toml"), done.err
        assert len(done.err) < 1500


def test_an_error_is_one_line_that_fits_a_screen(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_arrays(tmp_path / "agent", "k" * 100_000 + "\n\x1b[2Jend", {}, {"x": np.zeros(1)})
    done = Outcome(capsys, "export", tmp_path / "agent", "--out", tmp_path / "agent.c")
    assert done.is_refused("expected an agent")
    assert len(done.err) < 1500
    assert "\x1b" not in done.err
    long = UnusableInput("table.csv: " + "x" * 1_000_000 + "; do this")
    assert len(str(long)) < 1500
    assert str(long).startswith("table.csv: ")
    assert str(long).endswith("; do this")
    words = str(UnusableInput("table.csv: " + "a word " * 100_000 + "; do this"))
    assert len(words) < 1500
    assert words.endswith("; do this")


@pytest.mark.parametrize(
    ("kind", "settings"), [(5, {}), ([], {}), (None, {}), ("pneumarm servo", None), ("pneumarm servo", [1])]
)
def test_agents_of_no_kind_are_damaged(tmp_path: Path, kind: object, settings: object) -> None:
    write_arrays(tmp_path / "agent", kind, settings, {"x": np.zeros(1)})  # type: ignore[arg-type]
    with pytest.raises(UnusableInput, match="damaged"):
        load_agent(tmp_path / "agent")


def test_weights_beyond_what_can_be_computed_with_are_refused(tmp_path: Path) -> None:
    write_arrays(tmp_path / "agent", "pneumarm servo", {}, {"x": np.array([1e307])})
    with pytest.raises(UnusableInput, match="too large"):
        load_agent(tmp_path / "agent")


@pytest.mark.parametrize("content", ["", "null", "[]", "5", "{", "[" * 50_000, "NaN", '{"a": ' + "9" * 10_000 + "}"])
@pytest.mark.parametrize("file", ["settings.json", "results.json", "adaptation.json"])
def test_json_of_a_run_that_is_none_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], file: str, content: str
) -> None:
    (tmp_path / file).write_text(content)
    command = {"settings.json": ["run", "--out"], "results.json": ["report"], "adaptation.json": ["versions"]}[file]
    assert Outcome(capsys, *command, tmp_path).is_refused(file, "expected")


@pytest.mark.parametrize("content", ['{"collect": 5}', '{"simulation": []}', '{"collect": null}'])
def test_results_that_are_no_tables_are_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str
) -> None:
    (tmp_path / "results.json").write_text(content)
    assert Outcome(capsys, "report", tmp_path).is_refused("results.json", "expected tables")


@pytest.mark.parametrize("columns", ["0", "-3", "3", "many", "9" * 5000])
def test_terminals_that_say_nonsense_get_tables_all_the_same(columns: str) -> None:
    environment = {**os.environ, "COLUMNS": columns}
    done = python("-m", "pneumarm", "--help", env=environment, check=True)
    assert "Begin here" in done.stdout


@pytest.mark.parametrize("closed", [">&-", "<&- >&- 2>&-"])
def test_streams_that_the_caller_has_closed_are_no_bug(tmp_path: Path, closed: str) -> None:
    program = (
        "import os, sys; from pneumarm.cli import main\n"
        "try: main(['completion', 'bash', '--json'])\n"
        f"finally: number = os.open({str(tmp_path / 'next')!r}, os.O_CREAT | os.O_WRONLY); "
        f"open({str(tmp_path / 'number')!r}, 'w').write(str(number))"
    )
    command = f"exec {shlex.join([sys.executable, '-c', program])} {closed}"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert "bug" not in done.stderr
    assert int((tmp_path / "number").read_text()) > 2  # of no file, or what is printed would go into it


def test_numbers_of_any_length_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    for arm in ("virtual:seed=" + "9" * 5000, "virtual:joints=" + "1" * 5000, "emulated:" * 500 + "virtual"):
        done = Outcome(capsys, "arm", "sensors", arm)
        assert done.is_refused("expected")
        assert len(done.err) < 1500


def test_a_row_of_an_experiment_may_not_be_nested_without_end(tmp_path: Path) -> None:
    (tmp_path / "rows.jsonl").write_text("[" * 100_000 + "\n")
    with pytest.raises(UnusableInput, match="line 1"):
        read_trial_rows(tmp_path / "rows.jsonl")


@pytest.mark.skipif(os.name == "nt", reason="needs links")
@pytest.mark.parametrize(
    ("suffix", "link"),
    [("-writer", os.symlink), ("-wal", os.symlink), ("-shm", os.symlink), ("-writer", os.link)],
)
def test_nothing_is_written_through_a_link_beside_a_store(
    tmp_path: Path, suffix: str, link: Callable[[Path, Path], None]
) -> None:
    victim, path = tmp_path / "victim", tmp_path / "arm.db"
    victim.write_text("precious")
    Store.create(path, ArmSpec()).close()
    link(victim, Path(f"{path}{suffix}"))
    with pytest.raises(UnusableInput, match=f"{suffix}: is .*remove it"):
        Store.append_to(path)
    assert victim.read_text() == "precious"


@pytest.mark.skipif(os.name == "nt", reason="needs links")
def test_nothing_is_written_through_a_link_where_a_temporary_file_may_be(tmp_path: Path) -> None:
    victim, path = tmp_path / "victim", tmp_path / "settings.json"
    victim.write_text("precious")
    (tmp_path / f".{path.name}.{os.getpid()}.part").symlink_to(victim)
    with written_whole(path) as temporary:
        assert temporary.parent.stat().st_mode & 0o077 == 0  # nobody else can put anything there
        temporary.write_text("{}")
    assert (victim.read_text(), path.read_text()) == ("precious", "{}")


@pytest.mark.parametrize("reader", ["table", "trajectory"])
def test_a_cell_without_end_is_no_table(tmp_path: Path, capsys: pytest.CaptureFixture[str], reader: str) -> None:
    file = tmp_path / "table.csv"
    file.write_text("trial,run 1\n1," + "2" * 1_000_000)
    assert Outcome(capsys, *READERS[reader](file)).is_refused("table.csv: expected")


@pytest.mark.parametrize("name", Movements._fields)
def test_movements_of_other_shapes_are_refused_before_they_are_computed_with(tmp_path: Path, name: str) -> None:
    by_joint = ("goal", "angle_begin", "angle_end", "velocity_end", "switches")
    known = {one: np.zeros((5, 2) if one in by_joint else 5) for one in Movements._fields}
    write_arrays(tmp_path / "it", "pneumarm movements", {}, known)
    Movements.load(tmp_path / "it")
    write_arrays(tmp_path / "it", "pneumarm movements", {}, known | {name: np.zeros((5, 5, 2))})
    with pytest.raises(UnusableInput, match="expected movements"):
        Movements.load(tmp_path / "it")
