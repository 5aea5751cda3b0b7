"""``pneumarm live`` as a program: it says where the page is, and leaves the arm vented when it is asked to end."""

import json
import os
import signal
import sys
from pathlib import Path

import pytest

from children import child, end
from live.noted_arm import NOTES, vented_after
from pneumarm.cli import main

HERE = Path(__file__).parent
START = "import sys; sys.path.insert(0, ''); from pneumarm.cli import main; main()"
IN_A_LOOP = """
import asyncio, sys
sys.path.insert(0, '')
from pneumarm.cli import main
async def cell():
    main()
asyncio.run(cell())
"""
"""As in a notebook, whose cells are run by a loop."""


@pytest.mark.parametrize("start", [START, IN_A_LOOP])
def test_it_ends_with_the_arm_vented(start: str, pid: Path, tmp_path: Path) -> None:
    notes = tmp_path / "notes"
    live = ["live", pid, "--arm", "python:noted_arm:noted", "--port", 0, "--no-browser", "--json"]
    with child(sys.executable, "-c", start, *live, cwd=HERE, env=os.environ | {NOTES: str(notes)}) as process:
        assert process.stderr is not None
        while "open http://127.0.0.1:" not in (line := process.stderr.readline()):
            assert line, "it ended before"
        output, _ = end(process, signal.SIGINT)
    assert process.returncode == 0
    assert json.loads(output)["figures"] == {}
    assert notes.read_text().endswith("0\n")  # closed in the end, ...
    assert vented_after(notes, 0.0) is None
    assert notes.read_text().splitlines()[-2].endswith(" 1")  # ... after it was vented


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nothing.agent"], "no file nothing.agent"),
        ([".", ".."], "folder of one run"),
        (["--host", "192.0.2.1"], "another --host or --port"),
        (["--arm", "nonsense"], "nonsense"),
    ],
)
def test_what_cannot_be_shown_is_said(
    arguments: list[str],
    words: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(["live", *arguments])
    assert ended.value.code == 2
    assert words in capsys.readouterr().err
