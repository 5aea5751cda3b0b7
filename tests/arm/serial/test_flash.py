"""The firmware that the package brings along, and how it gets onto a board."""

import shutil
import sys
from pathlib import Path

import pytest
from tests.firmware.build import hash_of_sources, missing
from tests.firmware.chip import Chip
from tests.firmware.host import Host

from children import python
from pneumarm.arm.serial.flash import BAUDS, FIRMWARE, flash
from pneumarm.cli import main
from pneumarm.errors import ArmFailure, UnusableInput

ROOT = Path(__file__).parents[3]


@pytest.fixture
def avrdude(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Put a stand-in for avrdude into the path, which notes how it is called and knows one boot loader."""
    note = tmp_path / "called"
    program = tmp_path / "bin" / "avrdude"
    program.parent.mkdir()
    program.write_text(
        f"#!{sys.executable}\nimport sys\n"
        f"open({str(note)!r}, 'a').write(' '.join(sys.argv[1:]) + '\\n')\n"
        f"known = '{BAUDS[1]}' in sys.argv and '{tmp_path / 'port'}' in sys.argv\n"
        "sys.exit('' if known else 'not in sync')\n".replace("''", "0")
    )
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(program.parent))
    for name in ("port", "other"):
        (tmp_path / name).touch()
    return note


def test_each_boot_loader_is_tried(avrdude: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["arm", "flash", f"serial:{tmp_path / 'port'}"])
    assert ended.value.code == 0
    assert "is flashed" in " ".join(capsys.readouterr().out.split())  # a long name of a port is wrapped
    calls = avrdude.read_text().splitlines()
    assert [f"-b {baud} " in call for baud, call in zip(BAUDS, calls, strict=True)] == [True, True]
    assert all(f"-P {tmp_path / 'port'} " in call and call.endswith(f"flash:w:{FIRMWARE}:i") for call in calls)


def test_what_avrdude_said_is_told(avrdude: Path, tmp_path: Path) -> None:
    with pytest.raises(ArmFailure, match="avrdude said: not in sync"):
        flash(str(tmp_path / "other"))


def test_without_a_port_or_avrdude_it_is_said_what_to_do(
    avrdude: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(UnusableInput, match="no such port"):
        flash(str(tmp_path / "nothing"))
    assert not avrdude.exists()
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UnusableInput, match="apt install avrdude"):
        flash(str(tmp_path / "port"))


@pytest.mark.skipif(bool(missing()), reason=missing())
def test_the_packaged_program_is_that_of_the_sources() -> None:
    """Else: make -C firmware package."""
    with Chip(FIRMWARE) as chip:
        assert Host(chip).connect().firmware == hash_of_sources()


def test_a_wheel_holds_every_file_of_the_package(tmp_path: Path) -> None:
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, tmp_path)
    source = ROOT / "src" / "pneumarm"
    shutil.copytree(source, tmp_path / "src" / "pneumarm", ignore=shutil.ignore_patterns("__pycache__"))
    build = "import sys; from setuptools.build_meta import build_wheel; print(build_wheel('wheels'))"
    python("-c", build, cwd=tmp_path, check=True)
    (wheel,) = (tmp_path / "wheels").glob("*.whl")
    shutil.unpack_archive(wheel, tmp_path / "unpacked", "zip")
    expected = {path.relative_to(source) for path in source.rglob("*") if path.is_file()}
    expected = {path for path in expected if "__pycache__" not in path.parts}
    inside = tmp_path / "unpacked" / "pneumarm"
    assert expected - {path.relative_to(inside) for path in inside.rglob("*") if path.is_file()} == set()
