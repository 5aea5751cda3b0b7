"""The pages in a real browser: on a phone, on a tablet and on a desk, light, dark and in print.

``PNEUMARM_SCREENSHOTS=folder make test-all`` keeps what is seen, for people to look at.
"""

import io
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import builders
import msgspec
import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser, Page

from children import python
from live.browser import PATIENCE, WIDTHS, emptiness, keep, opened_browser, smallest_text, too_wide
from live.chromium import missing
from once import made_once
from pneumarm.arm import open_arm
from pneumarm.arm.virtual import Leak
from pneumarm.checkup import diagnose, measure
from pneumarm.cli import main
from pneumarm.experiments.all_goals import EXPERIMENT as ALL_GOALS
from pneumarm.experiments.experiment import Row, sorted_rows
from pneumarm.experiments.preparation import STORE, claim
from pneumarm.experiments.results import write_page
from pneumarm.experiments.sweep import ROWS, arm_folder
from pneumarm.report.checkup import checkup_page
from pneumarm.report.files import ANALYSIS
from pneumarm.report.run_report import run_page, write_analysis
from pneumarm.report.sections import RunData
from pneumarm.task import Movements
from pneumarm.transitions import Store, collect

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing())
ROOT = Path(__file__).parents[2]
READABLE = 11.0  # px
LETTERS = 733.0  # px, of a figure of 7.4 inch whose smallest letters, of 8 points, are to be READABLE
MOST_EMPTY = 0.55
"""Of a printed page that is not the last: a heading, what is said under it and a figure stay together."""
DRAWN = ("report", "report of two joints", "simulation", "check-up", "experiment")
"""Pages that begin with a picture that plays, and have others."""
PAGES = {
    "report": "report.html",
    "report of two joints": "two.html",
    "simulation": ANALYSIS,
    "check-up": "checkup.html",
    "experiment": f"laboratory/{ALL_GOALS.name}/page.html",
    "claims": "laboratory/claims.html",
    "site": "site/index.html",
}

UNFOLD = "[...document.querySelectorAll('details')].map((one) => (one.open = true)).length"
"""Opens what is folded on a page, and says how many parts that are."""
FIGURES = ("reward", "actions", "switches", "episodes", "success_rate", "gain", "met", "learning success_rate")
"""Of a row of an experiment."""


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return a page of each kind; the site only where what builds it is installed."""
    folder = made_once(tmp_path_factory, "screens", make_pages)
    return {name: folder / file for name, file in PAGES.items() if name != "site" or (folder / file).exists()}


def make_pages(folder: Path) -> None:
    """Make a page of each kind in ``folder``."""

    def write(name: str, page: str) -> None:
        (folder / PAGES[name]).write_text(page, encoding="utf-8")

    run = builders.run(small=True)
    write("report", run_page(run))
    write("report of two joints", run_page(two_joints()))
    arm = open_arm("virtual:seed=3", 3)
    arm.faults = (Leak(joint=1, muscle=2, factor=30),)  # type: ignore[attr-defined]
    checkup = measure(arm)
    write("check-up", checkup_page(checkup, diagnose(checkup)))
    write_analysis(folder, run.spec, builders.coverage(), builders.quality(), {})
    make_laboratory(folder / "laboratory")
    if (done := python("-m", "mkdocs", "build", "--site-dir", folder / "site", cwd=ROOT)).returncode:
        assert "No module named" in done.stderr, done.stderr


def make_laboratory(folder: Path) -> None:
    """Make the pages of an experiment and of claims."""
    random, rows = np.random.default_rng(0), []
    for trial in ALL_GOALS.trials:
        for repeat in range(1, 5):
            rows.append(Row("virtual:seed=1", trial, repeat, {name: random.uniform(0.5, 1) for name in FIGURES}, 0.0))
    table = sorted_rows(rows)
    (folder / ALL_GOALS.name).mkdir(parents=True)
    recording = arm_folder(folder, table.arms[0])
    claim(recording, {"arm": table.arms[0]})
    with open_arm(table.arms[0]) as arm, Store.for_arm(recording / STORE, arm.spec) as store:
        collect(arm, store, 2000)
    write_page(ALL_GOALS, folder / ALL_GOALS.name, ALL_GOALS.analyse(table), table)
    lines = [msgspec.json.encode(row) + b"\n" for row in table.rows]
    (folder / ALL_GOALS.name / ROWS).write_bytes(b"".join(lines))
    with pytest.raises(SystemExit):
        main(["claims", "--out", str(folder)])


def two_joints() -> RunData:
    """Return a run of an arm of two joints whose figures are as long as they get."""
    run = builders.run(joints=2, small=True)
    assert run.test is not None

    def worse(episodes: Movements) -> Movements:
        return episodes._replace(reward=20 * episodes.reward - 300, switches=9 * episodes.switches)

    transfer = builders.transfer(2, (60, 60, 60))
    phases = {name: worse(phase) for name, phase in transfer.phases.items()}
    bound = json.loads(json.dumps(run.results["bound"]))
    for planner in ("open_loop", "closed_loop"):
        for figures in (bound[planner], bound[planner]["intervals"]):
            figures["switches"] = [figures["switches"], figures["switches"]]
    return replace(
        run, test=worse(run.test), transfer=replace(transfer, **phases), results={**run.results, "bound": bound}
    )


def page_named(pages: dict[str, Path], name: str) -> Path:
    if name not in pages:
        pytest.skip("mkdocs is not installed")
    return pages[name]


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with opened_browser() as browser:
        yield browser


def shown(browser: Browser, file: Path, width: int, **options: object) -> Page:
    page = browser.new_page(viewport={"width": width, "height": WIDTHS[width]}, **options)  # type: ignore[arg-type]
    page.set_default_timeout(PATIENCE)
    page.goto(file.as_uri())
    return page


def moving(page: Page) -> list[tuple[float, float, bool]]:
    """Return of each playing picture its width, the width at which its letters are READABLE, and if it is cut."""
    found = page.evaluate(
        "[...document.querySelectorAll('.moving img')].map((one) =>"
        " [one.getBoundingClientRect().width, one.naturalWidth, one.getBoundingClientRect().right > innerWidth])"
    )
    return [(seen, READABLE / 14 * natural, cut) for seen, natural, cut in found]


def background(page: Page) -> int:
    """Return how light what is seen is between the letters, 0 to 255: the most frequent shade on the right."""
    seen = Image.open(io.BytesIO(page.screenshot())).convert("L")
    shades = seen.crop((seen.width // 3, seen.height // 8, seen.width, seen.height)).histogram()
    return shades.index(max(shades))


@pytest.mark.parametrize(("width", "scheme"), [*((width, "light") for width in WIDTHS), (800, "dark")])
@pytest.mark.parametrize("name", PAGES)
def test_a_page_fits_and_can_be_read(
    browser: Browser, pages: dict[str, Path], name: str, width: int, scheme: str
) -> None:
    page = shown(browser, page_named(pages, name), width, color_scheme=scheme)
    keep(page, f"{name}-{width}-{scheme}")
    if page.evaluate(UNFOLD):
        keep(page, f"{name}-{width}-{scheme}-unfolded")
    assert too_wide(page) <= 0
    size, text = smallest_text(page)
    assert size >= READABLE, text
    if name == "site":
        shown_picture = page.evaluate("document.querySelector('picture img').currentSrc")
        assert shown_picture.endswith("arm-narrow.svg" if width == 400 else "arm.svg")
    if name in DRAWN:
        assert moving(page)
        widths = page.evaluate(
            "[...document.querySelectorAll('.drawing img')].map((one) => one.getBoundingClientRect().width)"
        )
        assert len(widths) >= 3
        assert min(widths) >= LETTERS
        assert all(seen >= least and not cut for seen, least, cut in moving(page))
    assert background(page) > 240 if scheme == "light" else background(page) < 60  # of the contents, too
    page.close()


@pytest.mark.parametrize("name", PAGES)
def test_on_a_desk_nothing_on_a_page_scrolls_sideways(browser: Browser, pages: dict[str, Path], name: str) -> None:
    page = shown(browser, page_named(pages, name), 1280)
    page.evaluate(UNFOLD)
    hidden = page.evaluate(
        "[...document.querySelectorAll('.scroll')].filter((one) => one.scrollWidth > one.clientWidth)"
        ".map((one) => one.textContent.trim().slice(0, 80))"
    )
    assert hidden == []
    page.close()


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_printed_light_and_whole(browser: Browser, pages: dict[str, Path], name: str) -> None:
    page = shown(browser, page_named(pages, name), 800, color_scheme="dark")
    page.emulate_media(media="print", color_scheme="dark")
    assert background(page) > 250
    assert too_wide(page) <= 0
    left = emptiness(page, name)
    assert max(left[:-1], default=0) <= MOST_EMPTY, left
    page.close()
