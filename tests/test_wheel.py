"""The wheel holds all that the package needs, and a new user's walk through the README works with it."""

import os
import shutil
import signal
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path
from time import monotonic

import pytest

from children import LIMIT, child, wait_until
from pneumarm.cli import COMMANDS
from readme import blocks, commands

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src"
INSTALLING = 1200.0
"""So long [s] may installing all libraries take."""
A_COMMAND = 1800.0
"""And a command, with all that it compiles."""
HARDWARE, EMULATED = "serial:/dev/ttyACM0", "emulated:virtual:seed=7"
"""Who has no board gets the emulated one, as fast as it can be computed."""
OPEN_ENDED = {("live",): "http://", ("arm", "emulate"): "arm.port"}
"""Commands that go on until they are stopped, and what they say once they are ready."""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the wheel, built of a copy of the checkout: building leaves files behind."""
    pytest.importorskip("setuptools")
    folder = tmp_path_factory.mktemp("wheel")
    copy = folder / "checkout"
    shutil.copytree(SOURCE, copy / "src", ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, copy)
    options = ("--no-deps", "--no-build-isolation", "--disable-pip-version-check", "--wheel-dir", folder)
    command = [sys.executable, "-m", "pip", "wheel", *map(str, options), str(copy)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, check=False)
    assert done.returncode == 0, done.stderr
    (built,) = folder.glob("*.whl")
    return built


def environment_of(folder: Path) -> dict[str, str]:
    """Return the variables of a user who has nothing yet: no path to the checkout, nothing compiled."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "PNEUMARM"))}
    return {
        **kept,
        "PNEUMARM_CACHE": str(folder / "cache"),
        "PATH": f"{folder / 'venv' / 'bin'}{os.pathsep}{kept['PATH']}",
    }


def test_the_wheel_holds_every_file_of_the_package(wheel: Path) -> None:
    held = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    files = {path.relative_to(SOURCE).as_posix() for path in (SOURCE / "pneumarm").rglob("*") if path.is_file()}
    wanted = {name for name in files if "__pycache__" not in name and not name.endswith(".md")}
    assert wanted - held == set()
    assert held - files == set()


def test_installed_outside_the_checkout_it_answers(wheel: Path, tmp_path: Path) -> None:
    """With the libraries of this environment, so that it needs no network."""
    venv.create(tmp_path / "venv", with_pip=False)
    python = tmp_path / "venv" / "bin" / "python"
    (site,) = (tmp_path / "venv").glob("lib/python*/site-packages")
    (site / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n")
    install = [sys.executable, "-m", "pip", "--python", str(python), "install", "--no-deps", "--no-index", str(wheel)]
    done = subprocess.run(install, capture_output=True, text=True, timeout=LIMIT, check=False)
    assert done.returncode == 0, done.stderr
    where = "import pneumarm; print(pneumarm.__file__)"
    for arguments in (("-c", where), ("-m", "pneumarm", "--help"), ("-m", "pneumarm", "arm", "flash", "--help")):
        done = subprocess.run(
            [str(python), *arguments],
            capture_output=True, text=True, timeout=LIMIT, check=False, cwd=tmp_path, env=environment_of(tmp_path),
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        if arguments[0] == "-c":
            assert Path(done.stdout.strip()).is_relative_to(site)
    found = subprocess.run(
        [str(tmp_path / "venv" / "bin" / "pneumarm"), "completion", "bash"],
        capture_output=True, text=True, timeout=LIMIT, check=True, cwd=tmp_path, env=environment_of(tmp_path),
    )  # fmt: skip
    assert all(command.split()[0] in found.stdout for command in COMMANDS)


@pytest.mark.walk
def test_a_new_users_walk_through_the_readme(wheel: Path, tmp_path: Path) -> None:
    """Installed by pip into a fresh environment, what the README and its pages say is done."""
    venv.create(tmp_path / "venv", with_pip=True)
    environment, desk = environment_of(tmp_path), tmp_path / "desk"
    desk.mkdir()
    install = [str(tmp_path / "venv" / "bin" / "python"), "-m", "pip", "install", "--quiet", str(wheel)]
    began = monotonic()
    installed = subprocess.run(install, capture_output=True, text=True, timeout=INSTALLING, check=False, cwd=desk)
    if "No matching distribution" in installed.stderr or "Could not find a version" in installed.stderr:
        pytest.skip("no package index can be reached")
    assert installed.returncode == 0, installed.stderr
    spent = [("pip install", monotonic() - began)]

    def walk(command: list[str], folder: Path = desk) -> None:
        began = monotonic()
        name = tuple(one for one in command[1:3] if one.isalpha())
        ready = next((words for first, words in OPEN_ENDED.items() if name[: len(first)] == first), None)
        with child(*command, cwd=folder, env=environment, stderr=subprocess.STDOUT) as process:
            said = ""
            if ready is not None:
                assert process.stdout is not None
                for line in process.stdout:
                    said += line
                    if ready in line:
                        break
                process.send_signal(signal.SIGINT)
            rest, _ = process.communicate(timeout=A_COMMAND)
            said += rest
        assert process.returncode == 0, (command, said)
        spent.append((" ".join(command[:4]), monotonic() - began))

    (desk / "runs").mkdir()
    walk(["pneumarm", "run", "--out", "runs/first"])  # what `make run` does
    for number, command in enumerate(commands()):
        own = desk / f"own-{number}"  # runs of other arms share the name of their folder, and stores theirs
        line = [one.replace(HARDWARE, EMULATED) for one in command]
        if line[:2] == ["pneumarm", "run"] or line[-2:] == ["--sensors", "temperature"]:
            own.mkdir()
            if line[1] == "fit":
                arm = "virtual:seed=7,sensors=velocity+temperature"
                walk(["pneumarm", "collect", arm, "arm.db", "--transitions", "4000"], own)
            if "spec=arm.toml" in " ".join(line):
                shutil.copy(desk / "arm.toml", own)
            walk(line, own)
        else:
            walk(line)
    (program,) = blocks("python")
    walk(["python", "-c", program])
    for name, seconds in spent:
        print(f"{seconds:7.1f} s  {name}")
    print(f"{sum(seconds for _, seconds in spent):7.1f} s  in all")
    assert (desk / "moves.gif").read_bytes().startswith(b"GIF8")
    wait_until("nothing is left that runs", lambda: not (desk / "arm.port").exists())
