"""Progress: lines where there is no terminal, a bar where there is one, compiling named and counted once."""

import json
import logging
import os
import pty
import re
import shutil
import sys
from dataclasses import replace
from pathlib import Path
from time import monotonic

import msgspec
import numba
import pytest

from children import LIMIT, child, python, wait_until
from pneumarm import progress as module
from pneumarm.cli import main
from pneumarm.commands.run_ import _write_config
from pneumarm.learning import Shaping
from pneumarm.progress import Stage, compiling, progress
from pneumarm.run import Run
from small import SMALL


def lines_of(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.getMessage() for record in caplog.records if record.levelno == logging.INFO]


@pytest.fixture(autouse=True)
def _logger_as_a_library_has_it(monkeypatch: pytest.MonkeyPatch) -> None:
    log = logging.getLogger("pneumarm")
    monkeypatch.setattr(log, "handlers", [])
    monkeypatch.setattr(log, "propagate", True)


def test_without_a_terminal_lines_say_where_it_is(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also while it reports nothing: a stage that only compiles is no silent one."""
    monkeypatch.setattr(module, "_EVERY", 0.01)
    with caplog.at_level(logging.INFO, logger="pneumarm"), progress("doing") as report:
        wait_until("a line before anything is reported", lambda: any("doing: 0 s" in one for one in lines_of(caplog)))
        report(1, 4)
        wait_until("a line with an estimate", lambda: any("1 of 4" in one for one in lines_of(caplog)))
    said = lines_of(caplog)
    assert any(re.fullmatch(r"doing: 1 of 4, \d+ s, about \d+ s left", one) for one in said), said
    assert re.fullmatch(r"doing: done in \d+\.\d s", said[-1])


def test_what_fails_is_not_said_to_be_done(caplog: pytest.LogCaptureFixture) -> None:
    with (
        caplog.at_level(logging.INFO, logger="pneumarm"),
        pytest.raises(ValueError, match="wrong"),
        progress("doing"),
    ):
        raise ValueError("wrong")
    assert lines_of(caplog) == []


def test_compiling_is_named_and_counted_once(caplog: pytest.LogCaptureFixture) -> None:
    """A kernel that compiles another takes as long as both: their times are not added."""

    @numba.njit
    def inner(x: float) -> float:
        return x + 1

    @numba.njit
    def outer(x: float) -> float:
        return inner(x) * 2

    stage, before, began = Stage("doing"), compiling.seconds, monotonic()
    with caplog.at_level(logging.DEBUG, logger="pneumarm"):
        assert outer(1.0) == 4
    took = monotonic() - began
    assert 0 < compiling.seconds - before <= took
    assert stage.compiling == compiling.seconds - before
    assert not compiling.now
    named = [record.getMessage() for record in caplog.records]
    assert len([one for one in named if "outer in" in one]) == 1
    assert not any("inner in" in one for one in named)
    spent = compiling.seconds
    assert outer(2.0) == 6
    assert compiling.seconds == spent
    compiling.begin()
    assert "compiling, once on this machine" in stage.where()
    compiling.end("nothing")
    assert "compiling" not in stage.where()


def test_on_a_terminal_there_is_a_bar_with_the_time_that_is_left() -> None:
    """Names do not wrap where a line has 80 letters."""
    program = (
        "from time import sleep\n"
        "from pneumarm.progress import progress, print_lines\n"
        "print_lines('info')\n"
        "with progress('stage 4 of 7: testing in the simulation') as report:\n"
        "    for i in range(5): report(2500 * i, 10000); sleep(0.05)\n"
    )
    ours, theirs = pty.openpty()
    seen = b""
    with child(
        sys.executable, "-c", program, stderr=theirs, env={**os.environ, "TERM": "xterm", "COLUMNS": "80"}
    ) as process:
        os.close(theirs)
        while True:
            try:
                some = os.read(ours, 4096)
            except OSError:  # nobody is at the other end
                break
            if not some:
                break
            seen += some
        assert process.wait(LIMIT) == 0
    os.close(ours)
    assert b"stage 4 of 7: testing in the simulation" in seen
    assert b"10000/10000" in seen
    assert b"left" in seen


def test_only_stages_that_are_done_are_counted(
    small_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An agent that reaches goals does not settle; movements are not planned where nobody asked for that."""
    monkeypatch.setattr("pneumarm.report.beside.ReportBeside.write", lambda page: None)
    for planned, last in ((8, 7), (0, 6)):
        folder = tmp_path / str(planned)
        shutil.copytree(small_run, folder)
        (folder / "report.html").unlink()
        settings = json.loads((folder / "settings.json").read_text()) | {"bound_episodes": planned}
        (folder / "settings.json").write_text(json.dumps(settings))
        run = Run(folder, replace(SMALL, bound_episodes=planned))
        run.do()
        assert run.numbered("writing") == f"stage {last} of {last}: writing"


@pytest.mark.parametrize(("level", "lines"), [("info", True), ("warning", False)])
def test_levels_decide_what_is_said(
    capsys: pytest.CaptureFixture[str], small_run: Path, level: str, lines: bool
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["coverage", str(small_run / "transitions.db"), "--json", "--log", level])
    out, err = capsys.readouterr()
    assert ended.value.code == 0
    assert "verdict" in json.loads(out)
    assert ("done in" in err) is lines


def test_an_unknown_level_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["coverage", "none.db", "--log", "loud"])
    assert ended.value.code == 2
    assert "debug, info, warning" in capsys.readouterr().err


def test_stages_of_a_run_are_numbered_and_its_time_is_the_true_one(small_run: Path, tmp_path: Path) -> None:
    """The last two stages are done again: the call says how long it took, and how long all did."""
    again = tmp_path / "again"
    shutil.copytree(small_run, again)
    (again / "report.html").unlink()
    results = json.loads((again / "results.json").read_text())
    del results["bound"]
    results["wall_seconds"]["collect"] = 1e6
    (again / "results.json").write_text(json.dumps(results))
    settings = json.loads((again / "settings.json").read_text())
    settings["thesis"]["shaping"] = msgspec.to_builtins(Shaping())  # shaping is no option
    (again / "settings.json").write_text(json.dumps(settings))
    _write_config(tmp_path / "run.toml", {"out": str(again), **msgspec.to_builtins(SMALL)})
    began = monotonic()
    done = python("-m", "pneumarm", "run", "--config", tmp_path / "run.toml")
    took = monotonic() - began
    assert done.returncode == 0, done.stderr
    stages = re.findall(r"^stage (\d) of 7: .*: done in", done.stderr, re.M)
    assert stages == ["6", "7"]
    said = re.search(r"done in (\d+) s(?:, \d+ s of them compiling.*?)?; (\d+) s with the calls before", done.stderr)
    assert said, done.stderr
    assert int(said[1]) <= round(took)
    assert int(said[2]) >= 1e6


def test_bash_completes_commands_and_options(tmp_path: Path) -> None:
    """The script for bash is tried in bash; those for zsh and fish name all commands."""
    script = tmp_path / "completion.bash"
    script.write_text(python("-m", "pneumarm", "completion", "bash", check=True).stdout)

    def completed(*words: str) -> set[str]:
        line = " ".join(f"'{word}'" for word in words)
        code = f"source {script}; COMP_WORDS=({line}); COMP_CWORD={len(words) - 1}; _pneumarm; echo ${{COMPREPLY[@]}}"
        with child("bash", "-c", code) as process:
            out, errors = process.communicate(timeout=LIMIT)
        assert process.returncode == 0, errors
        return set(out.split())

    from pneumarm.cli import COMMANDS

    assert {command.split()[0] for command in COMMANDS} <= completed("pneumarm", "")
    assert {"check", "calibrate", "flash"} <= completed("pneumarm", "arm", "")
    assert completed("pneumarm", "tra") == {"train", "transfer", "track"}
    assert "--servo.tolerance" in completed("pneumarm", "train", "--servo.tol")
    assert completed("pneumarm", "run", "--preset", "") == {"minutes", "thesis"}


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_complete_too(tmp_path: Path, shell: str) -> None:
    script = json.loads(python("-m", "pneumarm", "completion", shell, "--json", check=True).stdout)["script"]
    assert all(word in script for word in ("calibrate", "servo.tolerance", "thesis", "help-all"))
    if shutil.which(shell):
        (tmp_path / "script").write_text(script)
        with child(shell, "-n", tmp_path / "script") as process:
            assert process.wait(LIMIT) == 0


def test_it_is_installed_where_the_shell_looks(tmp_path: Path) -> None:
    done = python(
        "-m", "pneumarm", "completion", "bash", "--install", "--json", env={**os.environ, "HOME": str(tmp_path)}
    )
    assert done.returncode == 0, done.stderr
    file = Path(json.loads(done.stdout)["file"])
    assert file.is_relative_to(tmp_path)
    assert "_pneumarm" in file.read_text()


def test_where_it_cannot_be_installed_is_told(tmp_path: Path) -> None:
    (tmp_path / "home").touch()
    environment = {**os.environ, "HOME": str(tmp_path / "home"), "MPLCONFIGDIR": str(tmp_path)}
    done = python("-m", "pneumarm", "completion", "fish", "--install", env=environment)
    assert done.returncode == 2
    assert re.fullmatch(r"pneumarm: \S+: cannot be written \(.*\n", done.stderr), done.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_an_answer_that_cannot_be_written_is_no_bug() -> None:
    with (
        open("/dev/full", "w") as full,
        child(sys.executable, "-m", "pneumarm", "completion", "bash", stdout=full) as process,
    ):
        _, errors = process.communicate(timeout=LIMIT)
    assert process.returncode == 1
    assert errors.startswith("pneumarm: standard output: No space left on device"), errors
