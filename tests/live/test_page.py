"""The page in a real browser: goals are dragged, movements drawn, faults switched, and a stop vents."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic

import pytest
from playwright.sync_api import Browser, Page, WebSocketRoute

from children import wait_until
from live.browser import WIDTHS, keep, opened_browser, smallest_text, too_wide, window
from live.chromium import missing
from live.noted_arm import board, vented_after
from live.serving import ARM, served
from pneumarm.live.live_arm import LiveArm
from pneumarm.live.server import LiveServer
from pneumarm.run import RunSettings

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing())
READABLE = 11.0  # px
LIMIT = 120.0  # s
KEYS = ("#charts .key.one", "#charts .key.two")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with opened_browser() as browser:
        yield browser


@contextmanager
def on_board(pid: Path, folder: Path) -> Iterator[tuple[LiveServer, Path]]:
    """Serve the page of an arm behind an emulated board and a serial port; give the notes of the board too."""
    with (
        board(folder) as (link, notes),
        served(LiveArm(RunSettings(arm=f"serial:{link}"), [str(pid)], None)) as server,
    ):
        yield server, notes


@contextmanager
def page_of(browser: Browser, server: LiveServer, width: int = 800, **options: object) -> Iterator[Page]:
    """Give a page in a window of its own; an error in it fails the test."""
    context = window(browser, width, **options)
    page, errors = context.new_page(), []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page.goto(server.url)
    try:
        page.locator("#angles b").first.wait_for()
        yield page
        assert errors == []
    finally:
        context.close()


def drag_to(page: Page, degrees: float) -> None:
    """Drag the goal with the mouse."""
    reach = page.evaluate(
        "(box => box.y + box.height / 2)(document.querySelector('#arm .weight:last-of-type').getBBox())"
    )
    place = page.evaluate(
        """([degrees, reach]) => {
          const turned = degrees * Math.PI / 180, matrix = document.getElementById("arm").getScreenCTM();
          const point = new DOMPoint(reach * Math.sin(turned), reach * Math.cos(turned)).matrixTransform(matrix);
          return [point.x, point.y];
        }""",
        [degrees, reach],
    )
    box = page.locator("#arm .handle").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(*place, steps=6)
    page.mouse.up()


def arrive(page: Page, degrees: float, within: float = 2.0) -> None:
    """Drag the goal there until the arm is there: a board vents the arm where this machine has too much to do."""

    def looked() -> bool:
        if mode(page) in ("failed", "stopped"):  # the same, and not even the board was heard
            page.locator("#stop").click()
            page.wait_for_timeout(500)
        elif mode(page) != "moving":
            drag_to(page, degrees)
        return abs(angle(page) - degrees) < within

    drag_to(page, degrees)
    comes(page, "the arm arrives", looked)


def mode(page: Page) -> str | None:
    return page.locator("body").get_attribute("data-mode")


def notice(page: Page) -> str:
    return page.locator("#notice").inner_text()


def angle(page: Page) -> float:
    return float(page.locator("#angles b").inner_text().rstrip("°").replace("\N{MINUS SIGN}", "-"))


def comes(page: Page, what: str, is_so: Callable[[], bool]) -> None:
    """Wait until something is so, while the page lives."""
    deadline = monotonic() + LIMIT
    while not is_so():
        assert monotonic() < deadline, f"{what}: not within {LIMIT:.0f} s, {page.locator('#stage').inner_text()}"
        page.wait_for_timeout(20)


def test_a_dragged_goal_is_moved_to_and_a_curve_followed(browser: Browser, server: LiveServer) -> None:
    with page_of(browser, server) as page:
        page.locator("body[data-role=writer]").wait_for()
        arrive(page, 20.0)
        arrive(page, -15.0)
        page.locator("#seconds").select_option("2")
        page.locator("#paper").evaluate("paper => paper.scrollIntoView({block: 'center'})")
        paper = page.locator("#paper").bounding_box()
        assert paper is not None
        x, y, width, height = paper["x"], paper["y"], paper["width"], paper["height"]
        page.mouse.move(x + 5, y + height * 0.6)
        page.mouse.down()
        page.mouse.move(x + width - 5, y + height * 0.3, steps=30)
        page.mouse.up()
        page.locator("body[data-mode=following]").wait_for()
        page.get_by_text("followed within").wait_for()
        page.locator("#relax").click()
        page.locator("body[data-mode=relaxed]").wait_for()


def test_a_fault_is_switched_on_and_told_to_all(browser: Browser, server: LiveServer) -> None:
    with page_of(browser, server) as page, page_of(browser, server, 400) as other:
        page.get_by_text("supply falls to 0.5 bar").click()
        other.locator("button[aria-pressed=true]", has_text="supply falls").wait_for()
        assert other.locator("#hold").is_disabled()


def test_a_slow_press_counts_while_figures_change(browser: Browser, server: LiveServer) -> None:
    with page_of(browser, server) as page:
        drag_to(page, 20.0)
        page.locator("body[data-mode=moving]").wait_for()
        page.locator("#offered").get_by_text("leaking muscle").click(delay=1500)
        page.locator("#on").get_by_text("leaking muscle, muscle 1").click(delay=1500)
        comes(page, "it is off again", lambda: page.locator("#on").inner_text() == "")


def test_a_stop_on_any_page_vents_an_arm_on_a_board(browser: Browser, pid: Path, tmp_path: Path) -> None:
    with on_board(pid, tmp_path) as (server, notes), page_of(browser, server) as page:
        with page_of(browser, server, 400) as watcher:
            arrive(page, 20.0)
            drag_to(page, -20.0)
            begun = monotonic()
            watcher.locator("#stop").click()
            comes(page, "everything is vented", lambda: vented_after(notes, begun) is not None)
            assert (vented_after(notes, begun) or 0.0) < 1.0  # `python -m benchmarks live` says how long it takes
            comes(watcher, "it is said", lambda: mode(watcher) in ("stopped", "failed"))
        if mode(page) == "stopped":  # and not failed, as where this machine is too busy to hear the board
            drag_to(page, 10.0)
            comes(page, "it stays so", lambda: "release it first" in notice(page) or mode(page) == "failed")
        page.locator("#stop").click()
        comes(page, "it is released", lambda: mode(page) == "relaxed")


def test_a_stop_without_a_connection_is_sent_once_there_is_one(browser: Browser, server: LiveServer) -> None:
    with page_of(browser, server) as page:
        down = True

        def through(socket: WebSocketRoute) -> None:
            if down:
                socket.close()
            else:
                socket.connect_to_server()

        page.route_web_socket("**/connection", through)
        page.reload()
        page.locator("body[data-role=lost]").wait_for()
        page.locator("#stop").click()
        assert "as soon as" in notice(page)
        down = False
        comes(page, "it is stopped", lambda: mode(page) == "stopped")


def test_an_arm_whose_page_is_killed_is_vented(browser: Browser, pid: Path, tmp_path: Path) -> None:
    with on_board(pid, tmp_path) as (server, notes):
        with page_of(browser, server) as page:
            arrive(page, 20.0, 10.0)
        begun = monotonic()
        wait_until("everything is vented", lambda: vented_after(notes, begun) is not None)


def test_ten_watch_while_one_moves_the_arm(browser: Browser, server: LiveServer) -> None:
    with page_of(browser, server) as page:
        context = window(browser, 400)
        watchers = [context.new_page() for _ in range(10)]
        for watcher in watchers:
            watcher.goto(server.url)
        arrive(page, 15.0)
        for watcher in watchers:
            comes(watcher, "it sees the arm arrive", lambda watcher=watcher: abs(angle(watcher) - 15) < 2)  # type: ignore[misc]
            assert watcher.locator("#role").inner_text().startswith("watching")
        context.close()


def test_muscle_1_is_on_the_side_to_which_it_pulls(browser: Browser, server: LiveServer) -> None:
    with page_of(browser, server) as page:
        arrive(page, 20.0)
        first, second = (page.locator(f"#arm .of-{muscle}") for muscle in (1, 2))
        assert first.locator(".name").text_content() == "muscle 1"
        parts = first.locator(".rubber"), second.locator(".rubber"), page.locator("#arm .weight").last
        places = [one.bounding_box() for one in parts]
        right, left, end = (box["x"] + box["width"] / 2 for box in places if box is not None)
        assert left < right < end
        bar = [float((one.get_by_text("bar").text_content() or "").removesuffix(" bar")) for one in (first, second)]
        assert bar[0] > bar[1]
        ink = [page.locator(key).evaluate("one => getComputedStyle(one, '::before').borderTopColor") for key in KEYS]
        drawn = [one.locator(".name").evaluate("one => getComputedStyle(one).fill") for one in (first, second)]
        assert drawn == ink


def test_what_can_be_done_and_what_is_done_is_said(browser: Browser, server: LiveServer) -> None:
    with page_of(browser, server) as page:
        assert "Drag the orange ring" in page.locator("#hint").inner_text()
        assert page.locator("#arm .handle path").first.is_visible()
        page.get_by_text("it needs 20 s of movement").wait_for()
        arrive(page, -20.0, 1.0)
        assert page.locator("#angles span").inner_text() == "goal \N{MINUS SIGN}20.0°"
        page.get_by_text("Holding its goal").wait_for()
        with page_of(browser, server, 400) as other:
            other.get_by_text("You are watching").wait_for()
            assert not other.locator("#arm .handle path").first.is_visible()
        page.get_by_text("Sine").click()
        page.get_by_text("Following the curve").wait_for()
        page.get_by_text("Holding the end of the curve").wait_for()


def test_a_page_that_hears_nothing_says_so(browser: Browser, pid: Path) -> None:
    with served(LiveArm(RunSettings(arm=ARM), [str(pid)], None)) as server:
        context = window(browser)
        page = context.new_page()
        page.add_init_script("window.WebSocket = class { readyState = 0; send() {} }; WebSocket.OPEN = 1;")
        page.goto(server.url)
        page.get_by_text("Waiting for the arm's first reading").wait_for()
        assert not page.locator("#arm").is_visible()
        context.close()
        context = window(browser)
        page = context.new_page()
        page.goto(server.url)
        page.get_by_text("Relaxed").wait_for()
        assert not page.get_by_text("Waiting for").is_visible()
        server.end()
        page.get_by_text("this is how it was last seen").wait_for()
        context.close()


def test_an_arm_with_one_muscle_is_drawn_with_a_spring_also_while_it_learns(browser: Browser, tmp_path: Path) -> None:
    settings = RunSettings(arm=f"{ARM},muscles=1", transitions=200_000)
    with served(LiveArm(settings, [], tmp_path / "run")) as server, page_of(browser, server) as page:
        assert page.locator("#arm .muscle").count() == 1
        assert page.locator("#arm .spring").get_by_text("spring").is_visible()
        assert page.get_by_text("muscle 2").all() == [] or not any(
            one.is_visible() for one in page.get_by_text("muscle 2").all()
        )
        page.locator("#begin").click()
        page.locator("body[data-mode=learning]").wait_for()
        page.get_by_text("times as fast as in reality").wait_for()
        assert not page.locator("#relax").is_enabled()
        page.locator("#stop").click()
        page.locator("body[data-mode=relaxed]").wait_for()
        page.get_by_text("what was recorded so far is kept").wait_for()
        assert page.locator("#begin").inner_text() == "Go on learning"


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_fits_and_can_be_read(browser: Browser, server: LiveServer, width: int, scheme: str) -> None:
    with page_of(browser, server, width, color_scheme=scheme) as page:
        drag_to(page, 10.0)
        comes(page, "the arm moves", lambda: abs(angle(page)) > 3)
        keep(page, f"live-{width}-{scheme}")
        assert too_wide(page) <= 0
        size, text = smallest_text(page)
        assert size >= READABLE, text
        stop = page.locator("#stop").bounding_box()
        assert stop is not None
        assert stop["height"] >= 48
        assert stop["y"] + stop["height"] <= WIDTHS[width]
