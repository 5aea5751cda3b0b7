"""What is told while an arm learns, also while nothing reports how far it is."""

from collections.abc import Callable
from pathlib import Path
from time import monotonic
from typing import Any

import pytest

from children import wait_until
from pneumarm.live.learning import STAGES, Learning, LeftOff
from pneumarm.live.screen import Screen
from pneumarm.progress import compiling
from pneumarm.run import Run, RunSettings


def learned(folder: Path, work: Callable[[Run, Screen], None], monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Return what was told of a run in which ``work`` is all the work."""
    screen = Screen()
    monkeypatch.setattr(Run, "do", lambda run: work(run, screen))
    Learning(folder / "run", RunSettings(), screen, lambda: False).do()
    return dict(screen.state["learning"])


def test_compiling_is_named_while_nothing_else_is_heard(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def work(run: Run, screen: Screen) -> None:
        with run.progress("training") as report:
            report(1, 4)
            compiling.begin()
            try:
                wait_until("it says so", lambda: screen.state["learning"]["compiling"])
            finally:
                compiling.end("kernel")
            assert (screen.state["learning"]["title"], screen.state["learning"]["share"]) == ("training", 0.25)

    told = learned(tmp_path, work, monkeypatch)
    assert told["done"]
    assert not told["compiling"]


def test_time_goes_on_and_stages_are_ticked_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def work(run: Run, screen: Screen) -> None:
        begun = monotonic()
        run.results["collect"] = {"transitions": 3000, "seconds": 120.0}
        wait_until("a second has passed", lambda: screen.state["learning"]["seconds"] >= 1)
        assert monotonic() - begun > 0.4
        states = [stage["state"] for stage in screen.state["learning"]["stages"]]
        assert states == ["done", "now"] + ["to come"] * (len(STAGES) - 2)
        assert screen.state["learning"]["stages"][0]["figures"] == "3,000 readings, 2 min of the arm's time"

    told = learned(tmp_path, work, monkeypatch)
    assert told["stages"][-1]["state"] == "done"
    assert told["report"].endswith("report.html")


def test_a_stop_ends_it_at_the_next_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Screen()

    def work(run: Run) -> None:
        with run.progress("training") as report:
            report(1, 4)

    monkeypatch.setattr(Run, "do", work)
    with pytest.raises(LeftOff, match="kept"):
        Learning(tmp_path / "run", RunSettings(), screen, lambda: True).do()
    assert screen.state["learning"]["stopping"]
