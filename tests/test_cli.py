import json
import os
import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from children import LIMIT, python
from pneumarm.cli import COMMANDS, PANELS, main
from pneumarm.errors import PneumarmError
from pneumarm.learning.imported import ImportedPolicy
from pneumarm.run import Run
from pneumarm.simulation import Simulation
from pneumarm.transitions import Store
from readme import blocks, commands


class Outcome:
    """What a command left: exit code, stdout, stderr."""

    def __init__(self, capsys: pytest.CaptureFixture[str], *arguments: object) -> None:
        with pytest.raises(SystemExit) as ended:
            main([str(argument) for argument in arguments])
        self.code = ended.value.code
        self.out, self.err = capsys.readouterr()

    def is_refused(self, *words: str) -> bool:
        """Return whether it was refused with one line on stderr that holds ``words``."""
        return (
            self.code == 2
            and self.out == ""
            and self.err.startswith("pneumarm: ")
            and self.err.count("\n") == 1
            and all(word in self.err for word in words)
        )


@pytest.fixture
def store(small_run: Path) -> Path:
    return small_run / "transitions.db"


@pytest.fixture
def sim(small_run: Path) -> Path:
    return small_run / "simulation.safetensors"


@pytest.fixture
def agent(small_run: Path) -> Path:
    return small_run / "agent.safetensors"


@pytest.fixture
def missing(tmp_path: Path) -> Path:
    return tmp_path / "missing" / "file"


def test_help_answers_at_once_and_without_the_heavy_libraries() -> None:
    code = (
        "import sys; from pneumarm.cli import app; app(['--help'], result_action='return_value');"
        "sys.exit(len({'numba', 'numpy', 'matplotlib', 'scipy'} & sys.modules.keys()))"
    )
    done = python("-c", code, check=True)
    assert all(command.split()[0] in done.stdout for command in COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself_with_an_example(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    outcome = Outcome(capsys, *command.split(), "--help")
    assert outcome.code == 0
    assert f"pneumarm {command} " in outcome.out.replace("\n", " ")
    assert "Example:" in outcome.out
    assert "--json" in outcome.out


def test_wrong_commands_and_options_are_refused(capsys: pytest.CaptureFixture[str], store: Path, sim: Path) -> None:
    assert Outcome(capsys, "fitt", store).is_refused("fitt")
    assert Outcome(capsys, "fit", store).is_refused("--out")
    assert Outcome(capsys, "run", "x", "y").is_refused("pneumarm run: expected nothing more, got x y.", "--out x")
    assert Outcome(capsys, "import", "none.csv", "x.db").is_refused("no mapping none.csv.toml")
    assert Outcome(capsys, "fit", store, "--out", "x", "--hidden", "many").is_refused("--hidden", "many")
    assert Outcome(capsys, "fit", store, "--out", "x", "--history", 0).is_refused("history cannot be 0")
    train = ("train", sim, store, "--out", "x")
    assert Outcome(capsys, *train, "--method", "dqn").is_refused("method 'dqn'", "sarsa")
    assert Outcome(capsys, *train, "--agents", 0).is_refused("agents cannot be 0")
    assert Outcome(capsys, *train, "--policy.learning-rate", "nan").is_refused("learning_rate cannot be nan")
    assert not Path("x").exists()


def test_a_missing_parent_folder_is_refused_before_any_work(
    capsys: pytest.CaptureFixture[str], store: Path, sim: Path, agent: Path, missing: Path
) -> None:
    for arguments in (
        ("collect", "virtual", missing),
        ("fit", store, "--out", missing),
        ("train", sim, store, "--out", missing),
        ("export", store, "--out", missing.with_suffix(".csv")),
    ):
        assert Outcome(capsys, *arguments).is_refused(str(missing.parent), "does not exist"), arguments


def test_a_folder_that_is_itself_written_is_made_with_its_parents(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    store: Path,
    sim: Path,
    agent: Path,
    tmp_path: Path,
) -> None:
    def begun(run: Run) -> None:
        raise PneumarmError("far enough")

    monkeypatch.setattr(Run, "_collect", begun)
    table = tmp_path / "table.csv"
    table.write_text("trial,run 1,run 2\n" + "".join(f"{trial},{trial},{trial + 1}\n" for trial in range(1, 17)))
    (tmp_path / "file").touch()
    written = (
        ("run", "--arm", "virtual:seed=3"),
        ("analyse", store, sim),
        ("transfer", agent, "--arm", "virtual:seed=3", "--episodes", 1, "--test-episodes", 1),
        ("arm", "check", "virtual:seed=3"),
        ("taguchi", "analyse", table),
    )
    for arguments in written:
        under_a_file = Outcome(capsys, *arguments, "--out", tmp_path / "file" / "new" / "out")
        assert under_a_file.code == 2, (arguments, under_a_file.err)
        assert "file/new/out" in under_a_file.err.replace("\\", "/"), arguments
        deep = tmp_path / arguments[0] / "deep" / "out"
        made = Outcome(capsys, *arguments, "--out", deep)
        assert "far enough" in made.err if arguments[0] == "run" else made.code == 0, (arguments, made.err)
        assert any(deep.iterdir()), arguments


PIPED = """
import sys
from pneumarm.cli import main
from pneumarm.arm.virtual import VirtualArm
closed, close = [], VirtualArm.close
VirtualArm.close = lambda arm: (closed.append(1), close(arm))
try:
    main(sys.argv[2:])
finally:
    open(sys.argv[1], "w").write(str(len(closed)))
"""
"""The command line, which notes how many arms it has closed."""


@pytest.mark.parametrize("form", [[], ["--json"]])
def test_nobody_who_reads_is_no_error(form: list[str], agent: Path, tmp_path: Path) -> None:
    """As other programs end whose output goes into ``head``: quietly, with the number of SIGPIPE."""
    notes, db = tmp_path / "closed", tmp_path / "arm.db"
    for arguments, arms in (
        (["move", agent, "--arm", "virtual:seed=3", "5deg", "--hold", 0.5, *form], 1),
        (["collect", "virtual:seed=3", db, "--transitions", 1000, *form], 1),
        (["--help"], 0),
    ):
        nobody, written = os.pipe()
        os.close(nobody)
        command = [sys.executable, "-c", PIPED, notes, *arguments]
        done = subprocess.run([*map(str, command)], stdout=written, stderr=subprocess.PIPE, text=True, timeout=LIMIT)
        os.close(written)
        assert done.returncode == 141, (arguments, done.stderr)
        assert not re.search("Error|Traceback|Exception", done.stderr), arguments
        assert int(notes.read_text()) >= arms
    with Store.open(db) as store:
        assert store.transitions >= 1000


def test_files_of_another_kind_are_refused(
    capsys: pytest.CaptureFixture[str], store: Path, sim: Path, agent: Path, tmp_path: Path
) -> None:
    text = tmp_path / "notes.txt"
    text.write_text("no store, no simulation, no agent\n" * 100)
    out = tmp_path / "out"
    for arguments in (
        ("fit", text, "--out", out),
        ("coverage", text),
        ("analyse", text, sim, "--out", out),
        ("analyse", store, text, "--out", out),
        ("train", text, store, "--out", out),
        ("train", sim, text, "--out", out),
        ("train", agent, store, "--out", out),
        ("test", agent, agent, store),
        ("transfer", text, "--arm", "virtual", "--out", out),
        ("report", text),
        ("import", text, out, "--mapping", text),
        ("collect", "virtual", text),
    ):
        assert Outcome(capsys, *arguments).is_refused(), arguments
    assert not out.exists()
    assert text.read_text().startswith("no store")


def test_too_little_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path, agent: Path) -> None:
    assert Outcome(capsys, "collect", "virtual", tmp_path / "a.db", "--transitions", 999).is_refused("1,000")
    assert Outcome(capsys, "run", "--out", tmp_path / "run", "--transitions", 100).is_refused("1000")
    asked = ("transfer", agent, "--arm", "virtual", "--out", tmp_path / "t")
    assert Outcome(capsys, *asked, "--test-episodes", 0).is_refused(
        "test_episodes cannot be 0; expected a whole number, 1 or more"
    )
    assert not list(tmp_path.iterdir())


def test_an_unknown_arm_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for arm in ("wirtual", "virtual:seed=x", "virtual:preset=Z", "simulation:none", "python:os", "python:os:nothing"):
        assert Outcome(capsys, "collect", arm, tmp_path / "a.db").is_refused(), arm


def test_an_error_that_nobody_foresaw_says_that_it_is_a_bug(
    capsys: pytest.CaptureFixture[str], store: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unforeseen(path: Path) -> None:
        raise ZeroDivisionError("nobody thought of that")

    monkeypatch.setattr("pneumarm.commands.fit_.require_folder", unforeseen)
    outcome = Outcome(capsys, "fit", store, "--out", tmp_path / "sim", "--json")
    assert (outcome.code, outcome.out) == (1, "")
    assert outcome.err == (
        "pneumarm: ZeroDivisionError: nobody thought of that (a bug in pneumarm: PNEUMARM_DEBUG=1 shows where)\n"
    )


def test_an_arm_that_fails_in_the_middle_costs_nothing_that_was_stored(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "my_arm.py").write_text(
        "from pneumarm.arm.virtual import VirtualArm\n"
        "class Failing(VirtualArm):\n"
        "    reads = 0\n"
        "    def read(self):\n"
        "        self.reads += 1\n"
        "        if self.reads > 1500:\n"
        "            raise OSError('cable')\n"
        "        return super().read()\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    db = tmp_path / "a.db"
    outcome = Outcome(capsys, "collect", "python:my_arm:Failing", db, "--transitions", 5000)
    assert outcome.code == 1
    assert "OSError: cable" in outcome.err
    assert "run the same command again" in outcome.err
    kept = json.loads(Outcome(capsys, "coverage", db, "--json").out)["seen"]
    assert 1000 <= kept < 1500


def test_anyone_can_collect(
    capsys: pytest.CaptureFixture[str], agent: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trajectory = tmp_path / "up and down.csv"
    trajectory.write_text("1,-1\n" * 20 + "0,0\n" * 20 + "-1,1\n" * 20)
    for controller in (agent, trajectory):
        db = tmp_path / f"{controller.stem}.db"
        outcome = Outcome(
            capsys, "collect", "virtual:seed=3", db, "--transitions", 2030, "--controller", controller, "--json"
        )
        assert json.loads(outcome.out)["transitions"] == 2030
    wrong = tmp_path / "wrong.csv"
    wrong.write_text("1,2,3\n")
    asked = ("collect", "virtual", tmp_path / "no.db", "--controller")
    assert Outcome(capsys, *asked, wrong).is_refused("2 columns of valves")
    with open("/dev/null") as nobody:
        monkeypatch.setattr("sys.stdin", nobody)
        assert Outcome(capsys, *asked, "keyboard").is_refused("needs a terminal")
    assert not (tmp_path / "no.db").exists()


def test_the_agent_of_another_arm_is_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, agent: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "other_arm.py").write_text(
        "from dataclasses import replace\n"
        "from pneumarm.arm.virtual import VirtualArm\n"
        "def slow():\n"
        "    arm = VirtualArm()\n"
        "    arm.spec = replace(arm.spec, period=0.05)\n"
        "    return arm\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    asked = ("transfer", agent, "--arm", "python:other_arm:slow", "--out", tmp_path / "t")
    assert Outcome(capsys, *asked).is_refused("period")


def test_json_is_one_object_on_stdout_and_nothing_else(
    capsys: pytest.CaptureFixture[str], store: Path, sim: Path, agent: Path, tmp_path: Path
) -> None:
    quantities = {"angle", "velocity", "pressure_1", "pressure_2"}
    figures = {"episodes", "reward", "success_rate", "actions", "switches"}

    def asked(*arguments: object) -> dict[str, object]:
        outcome = Outcome(capsys, *arguments, "--json")
        assert outcome.code == 0, outcome.err
        assert outcome.out.count("\n") == 1
        found: dict[str, object] = json.loads(outcome.out)
        return found

    fitted = asked("fit", store, "--out", tmp_path / "sim", "--epochs", 3)
    assert set(fitted["std"]) == set(fitted["relative_error"]) == quantities  # type: ignore[call-overload]
    logged = ("--tensorboard", tmp_path / "curves")
    trained = asked("train", sim, store, "--out", tmp_path / "agent", "--agents", 1, "--policy.updates", 5, *logged)
    assert {"episodes", "steps", "seconds", "steps_per_second_per_core"} <= trained.keys()
    assert list((tmp_path / "curves" / "agent-1").iterdir())
    assert figures | {"lookahead"} <= asked("test", agent, sim, store, "--episodes", 50).keys()
    out = ("--out", tmp_path / "t", "--episodes", 3, "--test-episodes", 4)
    moved = asked("transfer", agent, "--arm", "virtual:seed=3", *out)
    assert figures <= moved["before"].keys()  # type: ignore[attr-defined]
    assert Outcome(capsys, "versions", tmp_path / "t").is_refused("adaptation.json", "whose agent adapts")
    out = ("--out", tmp_path / "p", "--episodes", 3, "--test-episodes", 4)
    assert asked("transfer", tmp_path / "agent", "--arm", "virtual:seed=3", *out)["version"] == 0
    listed = asked("versions", tmp_path / "p", "--to", 0)
    assert listed["version"] == 0
    assert [row["in_use"] for row in listed["versions"]] == [True]  # type: ignore[attr-defined]
    assert Outcome(capsys, "versions", tmp_path / "p", "--to", 7).is_refused("there is no version 7")
    assert "verdict" in asked("coverage", store)
    asked("analyse", store, sim, "--out", tmp_path / "quality")
    assert (tmp_path / "quality" / "analysis.html").exists()
    asked("collect", "simulation:" + str(sim), tmp_path / "s.db", "--transitions", 2000)


def test_tables_for_people_have_words(
    capsys: pytest.CaptureFixture[str], store: Path, sim: Path, agent: Path, tmp_path: Path
) -> None:
    """No names of fields, no numbers with all their digits."""
    covered = Outcome(capsys, "coverage", store).out
    assert covered.startswith(("Enough: ", "Collect "))
    assert re.search(r"cells of the state space seen +│ [\d,]+ of [\d,]+ ", covered)
    quick = ("--servo.updates", 2, "--servo.agents", 1)
    trained = Outcome(capsys, "train", sim, store, "--out", tmp_path / "a", *quick).out
    assert re.search(r"settled within 1°, of 40 goals +│ [\d.]+ % +│ 80 % or more", trained)
    assert all(f"│ {name}, " in trained for name in ("time", "rest error", "overshoot"))
    assert "reward" not in trained  # that would be a price, not the thesis' reward
    said = [
        covered,
        trained,
        Outcome(capsys, "track", tmp_path / "a", "--arm", "virtual:seed=3", "--reference", "sine:1Hz,5deg",
                "--seconds", 1).out,
        Outcome(capsys, "export", store, "--out", tmp_path / "arm.csv").out,
        Outcome(capsys, "import", tmp_path / "arm.csv", tmp_path / "again.db").out,
        Outcome(capsys, "analyse", store, sim, "--out", tmp_path / "quality").out,
        Outcome(capsys, "arm", "calibrate", "virtual:seed=3", "--out", tmp_path / "arm.toml").out,
        Outcome(capsys, "test", agent, sim, store, "--episodes", 20).out,
    ]  # fmt: skip
    assert re.match(r"sine:1Hz,5deg, 1\.0 s: RMS error [\d.]+°, \d+ valve changes, [\d.]+ l of air\n", said[2])
    tested = Outcome(capsys, "test", tmp_path / "a", sim, store, "--episodes", 20).out
    assert tested.index("settled within 1°") < tested.index("The thesis' task, for which this agent was not trained")
    assert "not trained" not in said[-1]  # that one was trained to reach goals
    for one in said:
        assert one
        assert re.findall(r"│ [a-z]+_\w+|\b(?:None|True|False)\b|\d\.\d{7}", one) == []


def test_the_file_of_a_simulation_is_an_agent_that_plans_in_it(
    capsys: pytest.CaptureFixture[str], store: Path, sim: Path, tmp_path: Path
) -> None:
    tested = Outcome(capsys, "test", sim, sim, store, "--episodes", 20, "--json")
    assert json.loads(tested.out)["success_rate"] > 0.5
    out = ("--out", tmp_path / "t", "--episodes", 0, "--test-episodes", 3)
    assert (
        json.loads(Outcome(capsys, "transfer", sim, "--arm", "virtual:seed=3", *out, "--json").out)["episodes"] == 0
    )


def test_an_agent_of_another_library_is_tested_and_transferred(
    capsys: pytest.CaptureFixture[str], store: Path, sim: Path, tmp_path: Path
) -> None:
    """Layers such as the importer leaves; how well they move matters less here than that they go all the way."""
    simulation, random = Simulation.load(sim), np.random.default_rng(0)
    sizes = [simulation.window.state_size + 1, 64, 64, 9]
    layers = tuple(
        (random.normal(0, n**-0.5, (n, m)).astype(np.float32), np.zeros(m, np.float32)) for n, m in pairwise(sizes)
    )
    file = tmp_path / "theirs.agent"
    parts = (simulation.spec, simulation.window, simulation.scaling, simulation.goal_range)
    ImportedPolicy(*parts, layers).save(file)
    tested = Outcome(capsys, "test", file, sim, store, "--episodes", 20, "--json")
    assert tested.code == 0, tested.err
    figures = json.loads(tested.out)
    assert figures["episodes"] == 20
    assert figures["lookahead"] is None
    out = tmp_path / "t"
    options = ("--arm", "virtual:seed=3", "--out", out, "--episodes", 2, "--test-episodes", 3, "--json")
    moved = Outcome(capsys, "transfer", file, *options)
    assert moved.code == 0, moved.err
    results = json.loads(moved.out)
    assert (results["before"]["episodes"], results["after"]["episodes"], results["adaptations"]) == (3, 3, 0)
    assert (out / "adapted.safetensors").read_bytes() == file.read_bytes()  # it cannot learn here


@pytest.mark.long
def test_the_commands_and_the_program_of_the_readme_run(tmp_path: Path) -> None:
    found = commands("sh")
    assert len(found) >= 7
    for command in found:
        if command[1:3] == ["arm", "errors"]:
            continue  # takes minutes, as does the test of its own, which looks at all that it finds
        done = python("-m", "pneumarm", *command[1:], cwd=tmp_path)
        assert done.returncode == 0, (command, done.stderr)
    (program,) = blocks("python")
    done = python("-c", program, cwd=tmp_path, check=True)
    degrees = float(np.asarray(re.findall(r"-?\d+\.\d*", done.stdout)[-1]))
    assert abs(degrees - 12) < 3


def test_help_has_two_levels(capsys: pytest.CaptureFixture[str]) -> None:
    few, everything = (Outcome(capsys, "run", level).out for level in ("--help", "--help-all"))
    assert few.count("--") < 30
    assert few.count("\n") <= 30
    assert int(re.findall(r"Show (\d+) more options", few)[0]) <= 105
    assert "--servo.tolerance" not in few
    assert "--help-all" in few
    assert "(thesis" not in few
    assert "--servo.tolerance" in everything
    assert "(thesis" in everything
    assert all(f"╭─ {part} ─" in everything for part in ("servo", "collect", "own", "fit", "moving"))


def test_what_only_programs_turn_is_no_option(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Neither of commands nor in their files; a controller's own findings, for one, are no option of a run."""
    shown = Outcome(capsys, "run", "--help-all").out
    file = tmp_path / "run.toml"
    for option, table in (("ways", "servo"), ("noise.factor", "policy"), ("begin.settle", "collect")):
        assert f"--{table}.{option}" not in shown
        assert Outcome(capsys, "run", f"--{table}.{option}", 1).is_refused(f"--{table}.{option}")
        file.write_text(f"[run.{table}]\n{option} = 1\n")
        assert Outcome(capsys, "run", "--config", file, "--write-config", tmp_path / "no.toml").is_refused(
            *option.split(".")
        )
    written = tmp_path / "written.toml"
    assert Outcome(capsys, "run", "--write-config", written).code == 0
    assert "tolerance = " in written.read_text()
    assert not {"ways", "noise", "reward"} & set(re.findall(r"\w+", re.sub(r"#.*", "", written.read_text())))


def test_every_command_is_in_a_panel_of_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    placed = [name for names in PANELS.values() for name in names if not name.startswith("-")]
    assert sorted(placed) == sorted({command.split()[0] for command in COMMANDS})
    said = Outcome(capsys, "--help").out
    assert [said.index(title) for title in PANELS] == sorted(said.index(title) for title in PANELS)
    assert said.index("│ run ") < said.index("│ live ")


def test_help_has_no_words_of_programmers(capsys: pytest.CaptureFixture[str]) -> None:
    for command in COMMANDS:
        said = Outcome(capsys, *command.split(), "--help-all").out
        for words in ("SERVERADDRESS", "--empty-", "[default: ()]", "[default: {}]", "[ARGS...]"):
            assert words not in said, command


def test_how_a_check_up_measures_is_told_by_help_all_alone(capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("check", "calibrate"):
        few, everything = (Outcome(capsys, "arm", command, level).out for level in ("--help", "--help-all"))
        assert "--measure.fill" not in few
        assert "--measure.fill" in everything


def test_help_says_what_reached_means(capsys: pytest.CaptureFixture[str]) -> None:
    said = " ".join(Outcome(capsys, "test", "--help").out.split())
    assert "A goal counts as reached, a success, at a reading" in said
    assert "within 25 counts" in said
    assert "Test an agent in a simulation." in Outcome(capsys, "--help").out


def test_options_come_from_a_file_and_the_command_line_goes_before_it(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, store: Path
) -> None:
    """All settings of a run are written, read again, and give the same settings."""
    first, second, third = (tmp_path / f"{name}.toml" for name in ("first", "second", "third"))
    given = ("--arm", "virtual:seed=7", "--servo.tolerance", 0.5, "--moving.frequencies", 1, "--fit.one-network")
    assert Outcome(capsys, "run", *given, "--write-config", first).code == 0
    assert "# Error that counts as settled [degrees]" in first.read_text()
    assert Outcome(capsys, "run", "--config", first, "--write-config", second).code == 0
    assert second.read_text() == first.read_text()
    assert Outcome(capsys, "run", f"--config={first}", "--seed", 9, "--write-config", third).code == 0
    assert Outcome(capsys, "run", "--write-config", third).is_refused("exists already")
    assert third.read_text() == first.read_text().replace("seed = 0", "seed = 9", 1)
    config = tmp_path / "options.toml"
    config.write_text("[fit]\nepochs = 2\n")
    fit = ("fit", store, "--out", tmp_path / "sim", "--config", config)
    assert max(json.loads(Outcome(capsys, *fit, "--json").out)["epochs"]) <= 2
    for text, words in (
        ("[fit]\nepoch = 2\n", "epoch"),
        ("[train]\nseed = 1\n", "no table [fit]"),
        ("fit = 3", "no table [fit]"),
        ("[fit", "TOML"),
        ('[fit]\nepochs = "many"\n', "epochs"),
    ):
        config.write_text(text)
        assert Outcome(capsys, *fit).is_refused(words), text
    assert Outcome(capsys, "fit", store, "--out", "x", "--config").is_refused("expected a file")
    assert Outcome(capsys, *fit[:-1], tmp_path / "none").is_refused("expected a TOML file")


def test_without_a_design_columns_have_numbers(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    table = tmp_path / "table.csv"
    table.write_text("trial,run 1\n" + "".join(f"{trial},{trial % 5}\n" for trial in range(1, 17)))
    said = Outcome(capsys, "taguchi", "analyse", table).out
    assert re.findall(r"│ +\d+ +│ (\d+) ", said)
    assert "factor" not in said
