"""The page of questions: who may answer and stop, and which answers count."""

import json
import threading
import urllib.error
import urllib.request
from collections.abc import Iterator

import pytest

from pneumarm.live.questions import QuestionPage


@pytest.fixture
def page() -> Iterator[QuestionPage]:
    page = QuestionPage("127.0.0.1", 0, "secret")
    with page.served():
        yield page


def ask(
    page: QuestionPage, path: str, body: bytes | None = None, token: str = "secret", **headers: str
) -> tuple[int, bytes]:
    url = f"http://127.0.0.1:{page.port}/{path}?token={token}"
    try:
        with urllib.request.urlopen(urllib.request.Request(url, body, headers)) as answered:
            return answered.status, answered.read()
    except urllib.error.HTTPError as error:
        return error.code, error.read()


def test_nobody_without_the_token_and_no_foreign_page_sees_answers_or_stops(page: QuestionPage) -> None:
    page.ask("Did it click?", ["yes", "no"], False)
    for path, body in (("", None), ("setup/shown", None), ("setup/answer", b"1 yes"), ("setup/stop", b"")):
        assert ask(page, path, body, token="guess")[0] == 403
        assert ask(page, path, body, Origin="http://elsewhere.example")[0] == 403
    assert page.answers.empty()
    assert not page.stopped.is_set()
    assert ask(page, "")[0] == 200
    assert ask(page, "live.css", token="")[0] == 200  # holds nothing of the arm


def test_only_the_first_answer_to_the_question_that_is_shown_counts(page: QuestionPage) -> None:
    page.say("Ready.")
    page.ask("Did it click?", ["yes", "no"], False)
    shown = json.loads(ask(page, "setup/shown")[1])
    assert (shown["said"], shown["question"], shown["choices"]) == (["Ready."], "Did it click?", ["yes", "no"])
    for body in (b"0 no", b"7 no", b"no", b"\xff", b"1 yes", b"1 no"):
        assert ask(page, "setup/answer", body)[0] == 204
    assert page.answers.get_nowait() == "yes"
    assert page.answers.empty()
    page.ask("How many?", [], True)
    assert ask(page, "setup/answer", b"2 " + b"9" * 5000)[0] == 204
    assert len(page.answers.get_nowait()) < 1000


def test_a_stop_interrupts_whoever_works_in_the_main_thread(page: QuestionPage) -> None:
    threading.Timer(0.1, ask, (page, "setup/stop", b"")).start()
    with pytest.raises(KeyboardInterrupt):
        threading.Event().wait(30.0)
    assert page.stopped.is_set()
