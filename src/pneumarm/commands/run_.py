"""``pneumarm run``."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from cyclopts import Parameter
from rich.table import Table

from pneumarm.commands.common import Json, Monitoring, Settings, move_command, open_page
from pneumarm.commands.config_file import as_config
from pneumarm.commands.figures import figure_rows, reaching_table
from pneumarm.commands.versions_ import say_history
from pneumarm.console import say, show, table
from pneumarm.control.condition import complaints
from pneumarm.errors import UnusableInput
from pneumarm.files import write_text
from pneumarm.progress import compiling, progress, seconds_since_start
from pneumarm.report.files import REPORT
from pneumarm.run import Run, RunSettings
from pneumarm.transitions import Store

_MENTIONED = 0.5  # s of compiling
_DONE = 0.05  # s; a stage that only notes that it was not asked for takes less


def run_(
    *,
    out: Path = Path("pneumarm-run"),
    preset: Literal["minutes", "thesis"] = "minutes",
    monitor: Monitoring = "stop",
    settings: Annotated[RunSettings, Settings] = RunSettings(),
    write_config: Path | None = None,
    no_browser: Annotated[bool, Parameter(negative="")] = False,
    json: Json = False,
) -> None:
    """Do the whole job: collect, fit, train, test, transfer, report.

    Parameters
    ----------
    out
        Folder of the run.

        It is created if it does not exist. A second call goes on where the first was interrupted.
    preset
        Sizes: minutes of the arm's time, or the thesis', hours.

        The thesis' sizes, and its way of collecting (valves open for whole periods), are taken for what no other
        option says.
    write_config
        Write all options into this TOML file, and stop.

        They are those given, with what each means; the file must not exist. Change there what you like and call
        `pneumarm run --config FILE`.
    no_browser
        Do not open the report at the end.

        It is opened where there is a screen and a terminal, and no environment variable CI.
    """
    if preset == "thesis":
        settings = settings.of_the_thesis()
    if write_config is not None:
        _write_config(write_config, {"out": str(out), **msgspec.to_builtins(settings)})
        return
    run = Run(out, settings, lambda title: progress(run.numbered(title)), monitor=monitor, tell=say)
    results = run.do()
    if "enough" in results["collect"]:
        say(results["collect"]["enough"]["verdict"])
    phases = {
        "in the simulation": results["test"],
        "on arrival": results["transfer"]["before"],
        "after adaptation": results["transfer"]["after"],
    }
    reaching = reaching_table(phases, trained_for=not run.settings.settles)
    show(results, json, lambda: [*how_it_moves(results), reaching])
    say_history(out)
    for stage, doing in (("collect", "collecting"), ("transfer", "moving")):
        for line in complaints(results[stage], doing):
            say(line)
    say("seconds of " + ", ".join(_spent(results)))
    beside = results["rehearsal_memory_mb"]
    also = f", {beside:.0f} MB in the process that compiled beside it" if beside else ""
    say(
        f"done in {_took(sum(results['wall_seconds'].values()))}, "
        f"at most {results['peak_memory_mb']:.0f} MB of memory{also}"
    )
    with Store.open(run.store) as store:
        say(f"move the arm with {move_command(out, settings.arm, store.spec, store.percentiles())}")
    page = (out / REPORT).resolve().as_uri()
    say(f"report: {page}")
    open_page(page, False if json or no_browser else None, sys.stdout)


def how_it_moves(results: dict[str, Any]) -> Iterator[Table]:
    """Yield a table of how the arm settled at goals and followed references, where it was tried."""
    found = results["settle"]
    if not found:
        return
    rows: list[tuple[str, str, str]] = [
        *figure_rows(found),
        ("valve changes a second", f"{found['valve_changes_per_second']:.0f}", ""),
    ]
    if "valve_changes_last_second" in found:  # not in results of a version before this
        rows.append(("valve changes in the last second", f"{found['valve_changes_last_second']:.0f} a joint", ""))
    for one in results["track"]:
        errors = ", ".join(f"{error:.2f}°" for error in one["rms_error_deg"])
        rows.append((f"follows {one['amplitude_deg']:.0f}°, {one['frequency_hz']:g} Hz, off by", errors, ""))
    yield table(("adapted, on the arm", "", "normal"), rows, title="How it moves")


def _spent(results: dict[str, Any]) -> Iterator[str]:
    """Say how long each stage that was done took and how much of that was compiling."""
    for stage, seconds in results["wall_seconds"].items():
        if seconds < _DONE:
            continue
        compiled = results["compile_seconds"][stage]
        yield f"{stage} {seconds:.1f}" + (f" ({compiled:.1f} compiling)" if compiled >= _MENTIONED else "")


def _took(stages: float) -> str:
    """Return in words how long this call took, and how long all ``stages`` [s] if calls before did some of them."""
    seconds, spent = seconds_since_start(), compiling.seconds
    words = f"{seconds:.0f} s"
    if spent >= _MENTIONED:
        words += f", {spent:.0f} s of them compiling, once on this machine"
    return words if stages <= seconds else f"{words}; {stages:.0f} s with the calls before"


def _write_config(file: Path, settings: dict[str, Any]) -> None:
    from pneumarm.cli import app  # which has loaded this module

    if file.exists():
        raise UnusableInput(f"{file}: exists already; give another name, or remove it first")
    write_text(file, as_config("run", settings, app))
    say(f"settings: {file}; use them with `pneumarm run --config {file}`")
