"""The live page on an emulated board in real time: how long a stop takes, and whether anything grows.

Board, page and browser are processes of their own, as they are where a real board moves an arm. A stop takes from the
press of the mouse on a page to the command at the board that vents all muscles; each is pressed while the arm is on
its way. PNEUMARM_LIVE_STOPS sets their number; PNEUMARM_LIVE_MINUTES sets for how long the arm is then moved about
and follows curves with ten pages open, of which one is killed and opened anew now and then. The memory of the program
and of a page is told at the beginning, after a quarter of the time, and in the end, and how fast both grow after that
quarter.
"""

import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from time import monotonic, sleep

import numpy as np

from benchmarks import _environment as environment
from pneumarm.arm import open_arm
from pneumarm.classical import TuneSettings, tune

ROOT = Path(__file__).parents[1]
STOPS = environment.whole("PNEUMARM_LIVE_STOPS", 30)
MINUTES = environment.number("PNEUMARM_LIVE_MINUTES", 2.0)
WATCHERS = 9
SAMPLES = 24  # of the memory; after each a watching page is killed and opened anew


@contextmanager
def started(*command: object, expect: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Start ``pneumarm`` with ``command``; give it and the line in which it said what to ``expect``."""
    both = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    with subprocess.Popen([sys.executable, "-m", "pneumarm", *map(str, command)], cwd=ROOT, **both) as process:
        try:
            lines = []
            for line in process.stdout:
                lines.append(line)
                if expect in line:
                    break
            else:
                raise RuntimeError("".join(lines))
            yield process, line.strip()
        finally:
            process.terminate()
            process.communicate(timeout=600)  # on a machine that has much else to do


def measure() -> Iterator[str]:
    """Yield what was measured."""
    sys.path.insert(0, str(ROOT / "tests"))
    from live.browser import opened_browser
    from live.chromium import missing
    from live.noted_arm import board

    if missing():
        yield f"not measured: {missing()}"
        return
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        place = Path(folder)
        pid = place / "arm.pid"
        with open_arm("virtual:seed=3") as arm:
            tune("pid", arm, TuneSettings(seconds=120)).save(pid)
        link, notes = stack.enter_context(board(place))
        live = started("live", pid, "--arm", f"serial:{link}", "--port", 0, "--no-browser", expect="open ")
        process, told = stack.enter_context(live)
        browser = stack.enter_context(opened_browser())
        page = browser.new_page(viewport={"width": 800, "height": 1000})
        page.goto(told.split()[-1])
        page.locator("body[data-role=writer]").wait_for()
        yield from _stops(page, notes)
        watchers = [browser.new_page(viewport={"width": 400, "height": 860}) for _ in range(WATCHERS)]
        for watcher in watchers:
            watcher.goto(told.split()[-1])
        yield from _memory(page, process.pid, watchers)


def _press(page, degrees: float) -> None:
    """Set the goal on the page."""
    place = page.evaluate(
        """(degrees) => {
          const turned = degrees * Math.PI / 180, arm = document.getElementById("arm");
          const point = new DOMPoint(180 * Math.sin(turned), 180 * Math.cos(turned));
          const at = point.matrixTransform(arm.getScreenCTM());
          return [at.x, at.y];
        }""",
        degrees,
    )
    page.mouse.click(*place)


def _stops(page, notes: Path) -> Iterator[str]:
    from live.noted_arm import vented_after

    took = []
    box = page.locator("#stop").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    random = np.random.default_rng(0)
    while len(took) < STOPS:
        _press(page, 25.0 if len(took) % 2 else -25.0)
        sleep(random.uniform(0.15, 0.35))
        if page.locator("body").get_attribute("data-mode") != "moving":
            sleep(0.5)
            continue  # the board has vented it by itself: this machine had too much to do
        page.mouse.move(x, y)
        begun = monotonic()
        page.mouse.down()
        page.mouse.up()
        page.locator("body[data-mode=stopped]").wait_for()
        sleep(0.1)
        after = vented_after(notes, begun)
        assert after is not None
        took.append(after)
        page.locator("#stop").click()
        page.locator("body[data-mode=relaxed]").wait_for()
    ms = 1e3 * np.array(took)
    within = (ms <= 100).mean()
    yield (
        f"a stop vents after {np.median(ms):.0f} ms (median), {np.quantile(ms, 0.95):.0f} ms (95 %), "
        f"{ms.max():.0f} ms at most of {len(ms)}; {within:.0%} within 100 ms"
    )


def _memory(page, process: int, watchers: list) -> Iterator[str]:
    begin, goal = monotonic(), 20.0
    samples = [(0.0, *_used(page, process))]
    yield f"at the beginning {_told(samples[-1])}"
    for k in range(1, SAMPLES + 1):
        _renew(watchers, k % len(watchers), page)
        while monotonic() < begin + 60 * MINUTES * k / SAMPLES:
            if page.locator("body").get_attribute("data-mode") in ("stopped", "failed"):
                page.locator("#stop").click()  # not even the board was heard: this machine had too much to do
                page.wait_for_timeout(500)
            _press(page, goal)
            goal = -goal
            page.wait_for_timeout(2500)
            if goal > 0:
                page.locator("#sine").click()
                page.wait_for_timeout(3000)
        samples.append(((monotonic() - begin) / 60, *_used(page, process)))
        if k in (SAMPLES // 4, SAMPLES):
            yield f"after {samples[-1][0]:.1f} min with {WATCHERS + 1} pages {_told(samples[-1])}"
    minutes, *kinds = np.array(samples[SAMPLES // 4 :]).T
    program, heap, nodes = (np.polyfit(minutes, values, 1)[0] for values in kinds)
    yield (
        f"since then the program grows by {1e3 * program:.0f} kB a minute, a page by {1e3 * heap:.1f} kB and "
        f"{nodes:.1f} nodes; {SAMPLES} pages were killed meanwhile"
    )


def _renew(watchers: list, place: int, page) -> None:
    """Kill the watching page at a ``place`` without a word, and open another like ``page``."""
    killed = watchers[place]
    watchers[place] = killed.context.browser.new_page(viewport={"width": 400, "height": 860})
    watchers[place].goto(page.url)
    with suppress(Exception):  # who crashes does not arrive
        killed.goto("chrome://crash", timeout=5000)
    killed.context.close()


def _used(page, process: int) -> tuple[float, float, float]:
    """Return what the program and the page hold [MB], and the nodes of the page."""
    status = Path(f"/proc/{process}/status").read_text()
    resident = int(re.findall(r"VmRSS:\s+(\d+)", status)[0]) / 1e3
    session = page.context.new_cdp_session(page)
    session.send("HeapProfiler.collectGarbage")
    heap = session.send("Runtime.getHeapUsage")["usedSize"] / 1e6
    nodes = session.send("Memory.getDOMCounters")["nodes"]
    session.detach()
    return resident, heap, nodes


def _told(sample: tuple[float, ...]) -> str:
    _, program, heap, nodes = sample
    return f"the program holds {program:.0f} MB, a page {heap:.1f} MB and {nodes:.0f} nodes"
