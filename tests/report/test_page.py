import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import builders
import numpy as np
import pytest

from pneumarm.arm import ArmSpec
from pneumarm.control import save_history
from pneumarm.errors import UnusableInput
from pneumarm.report.data import CoverageData, Demonstration, MovingData, QualityData, TrainingData
from pneumarm.report.files import TEST, save_demonstration, write_spec
from pneumarm.report.front import headline, lights
from pneumarm.report.ledger import beside_thesis, bound_table, ledger
from pneumarm.report.page import Section, Table, render
from pneumarm.report.run_report import read_run, run_page, write_report
from pneumarm.report.sections import RunData, adapted, all_sections, followed, moving, overview
from pneumarm.task import Movements, read_episodes, write_episodes
from pneumarm.task.movements import COLUMNS, movements
from test_words import offences

VOID = {"meta", "img", "source", "link", "br", "hr", "input"}
MOST_BYTES = 6e6


class Page(HTMLParser):
    """Collects elements and ids, and checks that every element is closed in order."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.ids, self.open, self.text = [], [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self.elements.append((tag, attrs))
        self.ids += [attrs["id"]] if "id" in attrs else []
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


FEW = builders.transfer(counts=(15, 30, 15))


@pytest.fixture(scope="module")
def html():
    return run_page(builders.run())


@pytest.fixture(scope="module")
def page(html):
    return Page(html)


def test_page_asks_nothing_of_any_network(html, page):
    for tag, attrs in page.elements:
        assert tag not in {"script", "link", "iframe", "object"}
        for name in ("src", "href", "srcset", "action", "data"):
            assert attrs.get(name, "#").startswith(("#", "data:image/svg+xml;base64,")), (tag, name)
    style = html[html.index("<style>") : html.index("</style>")]
    assert "url(" not in style
    assert "@import" not in style


def test_every_picture_has_a_caption_and_a_text_alternative(page):
    pictures = [attrs for tag, attrs in page.elements if tag == "img"]
    assert len(pictures) == 15  # with the one that plays
    assert all(len(attrs["alt"]) > 60 for attrs in pictures)
    tags = [tag for tag, _ in page.elements]
    assert tags.count("figcaption") == tags.count("figure") == len(pictures) + tags.count("table")


def test_all_alternatives_hold_computed_numbers_and_captions_name_the_thesis(html, page):
    for attrs in (attrs for tag, attrs in page.elements if tag == "img"):
        assert re.search(r"\d", attrs["alt"]), attrs["alt"]
        assert "nan" not in attrs["alt"]
    captions = re.findall(r"<img[^>]*>\s*</div>\s*<figcaption[^>]*>(.*?)</figcaption>", html, re.DOTALL)
    assert len(captions) == 14
    assert all("thesis" in caption for caption in captions)


def test_ids_are_unique_and_links_lead_to_sections(html, page):
    assert len(page.ids) == len(set(page.ids))
    links = [attrs["href"][1:] for tag, attrs in page.elements if tag == "a"]
    assert set(links) <= {attrs["id"] for tag, attrs in page.elements if tag == "section"}
    assert len(links) == 3  # of the lights
    assert "<nav" not in html
    referred = [attrs["aria-labelledby"] for _, attrs in page.elements if "aria-labelledby" in attrs]
    assert set(referred) <= set(page.ids)


def test_every_word_of_it_is_native(page):
    assert offences(" ".join(" ".join(page.text).split())) == []


def test_page_stays_small(html):
    assert len(html.encode()) < MOST_BYTES


def test_page_of_two_joints_shows_both_and_stays_small():
    two = run_page(replace(builders.run(joints=2, small=True), training=None, marked=None))
    assert len(two.encode()) < MOST_BYTES
    assert "Residue of the angle of joint 2" in two


def test_ledger_shows_means_and_intervals_of_every_phase():
    run = builders.run()
    table = ledger(run.test, run.transfer)
    assert table.header == ("", "in the simulation", "on arrival", "while learning", "after adaptation")
    columns = list(zip(table.header, *table.rows, strict=True))[1:]
    for row, episodes in zip(columns, (run.test, *run.transfer.phases.values()), strict=True):
        mean, low, high = (
            float(w.replace("−", "-").strip("()")) for w in row[2].replace("\u00a0to\u00a0", " ").split()
        )
        assert mean == pytest.approx(episodes.reward.mean(), abs=0.005)
        assert (low + high) / 2 == pytest.approx(mean, abs=0.011)
        assert row[3].startswith(f"{episodes.success.mean():.2%} (")
        assert float(row[5].split()[0]) == pytest.approx(episodes.actions[episodes.success].mean(), abs=0.051)
    assert columns[2][-1] == "1.8 h"


def test_switches_of_several_joints_stand_beside_each_other_as_sums():
    ahead = builders.tested(20.0)
    ahead["switches"], ahead["intervals"]["switches"] = [0.94, 1.04], [[0.8, 1.0], [0.9, 1.1]]
    run = builders.run(joints=2, small=True)
    table = ledger(run.test, run.transfer, ahead)
    switches = dict(zip(table.header, table.rows[5], strict=True))
    assert switches[""] == "switches"
    assert switches["… looking ahead"] == "1.98"


def test_figures_of_joints_are_told_apart():
    run = replace(builders.run(joints=2, small=True), training=None, marked=None)
    moved = {"track": [{"frequency_hz": 0.5, "amplitude_deg": 20.0, "rms_error_deg": [1.9, 0.68]}]}
    time = np.linspace(0, 1, 31)
    angle = np.stack([np.full(31, 500.0), np.full(31, 500.5)], axis=1)
    (tracked,) = followed(moved, run.spec)
    assert tracked.tables[0].header == ("sinusoid", "RMS error of joint 1 [°]", "RMS error of joint 2 [°]")
    assert tracked.tables[0].rows == [("0.5 Hz, 20°", "1.90", "0.68")]
    section = moving(MovingData(time, angle, angle), run.spec)
    names = dict(re.findall(r'y="([\d.]+)">(joint \d)<', str(section.figures[0].figure)))
    assert sorted(names.values()) == ["joint 1", "joint 2"]
    first, second = sorted(map(float, names))
    assert second - first >= 13  # px, of letters
    rows = {row[0]: row[1] for row in beside_thesis(run.results, run.quality, run.test, run.transfer, run.spec).rows}
    both = r"[\d.]+, [\d.]+"
    assert re.fullmatch(f"{both} measured; {both} by eq. 3.7", rows["std of error after 1 s, angle [°]"])


SETTLE = {
    "tolerance_deg": 1.0,
    "settled": 0.975,
    "movements": 40,
    "median_seconds": 0.4,
    "rest_error_deg": 0.1,
    "overshoot_deg": 0.75,
    "valve_changes_per_second": 7.0,
    "air_litres_per_movement": None,
}


def settled(**changes):
    run = builders.run(small=True)
    time, angle = np.linspace(0, 1, 31), np.full((31, 1), 500.0)
    return replace(run, moving=MovingData(time, angle, angle), results={**run.results, "settle": SETTLE | changes})


def test_a_run_that_settles_opens_with_large_figures_the_arm_and_three_questions():
    made = run_page(settled())
    order = ("97.5 %", "0.40 s", "0.10°", "0.8°", 'id="figure-1"', "Is my data enough?", "Is the simulation good?",
             "Is anything wrong with the arm?", "<details>", "The thesis&#39; task", "Reward, and")  # fmt: skip
    places = [made.index(part) for part in order]
    assert places == sorted(places)
    assert made.count('id="figure-1"') == 1
    assert made.count("normal: ") == 4


def test_only_the_front_of_a_run_is_unfolded():
    sections = all_sections(settled())
    assert [one.title for one in sections if not one.folded] == ["How it moves", "The thesis' task"]
    assert "not trained for that" in next(one for one in sections if one.title == "The thesis' task").text[0]


def test_results_without_overshoot_have_three_figures():
    made = settled()
    del made.results["settle"]["overshoot_deg"]
    assert len(headline(made)) == 3


def test_an_agent_that_reaches_opens_with_how_it_reaches():
    run = builders.run(small=True)
    first = headline(run)[0]
    assert first.name == f"reached, of {run.transfer.after.n} goals on the arm"
    assert first.value == f"{100 * run.transfer.after.success.mean():.4g} %"
    assert headline(RunData(ArmSpec(), {})) == []


def test_lights_say_what_is_known_and_lead_to_more():
    unknown = lights(RunData(ArmSpec(), {}))
    assert [one.good for one in unknown] == [None, None, None]
    results = {
        "collect": {"enough": {"verdict": "enough: the second half lowers the error not at all"}, "findings": []},
        "simulation": {"relative_error": {"angle": 0.1}},
    }
    assert [(one.good, one.answer) for one in lights(RunData(ArmSpec(), results))] == [
        (True, "Yes"),
        (True, "Yes"),
        (True, "No"),
    ]
    results["collect"] = {"enough": {"verdict": "collect as much again: it helps"}, **builders.found(builders.FOUND)}
    results["simulation"]["relative_error"]["angle"] = [0.1, 0.4]
    bad = lights(RunData(ArmSpec(), results))
    assert [one.good for one in bad] == [False, False, False]
    assert "60%" in bad[1].words
    assert bad[2].words == "Stuck valve: the inlet is stuck closed (joint 1, muscle 2, collecting)."
    titles = {section.title for section in all_sections(builders.run(small=True))}
    assert {one.title for one in bad} <= titles


def test_few_movements_are_not_averaged_in_a_figure():
    many, few = builders.run(), builders.run(small=True)
    titles = [[section.title for section in all_sections(run)] for run in (many, replace(few, transfer=FEW))]
    assert ["Transfer to the arm" in one for one in titles] == [True, False]


def test_comparison_names_ours_and_the_thesis():
    run = builders.run()
    rows = {row[0]: row for row in beside_thesis(run.results, run.quality, run.test, run.transfer, run.spec).rows}
    assert rows["std of one-step error, angle [°]"][1:] == ["0.29", "0.59", "table 5.2"]
    assert rows["std of error after 1 s, angle [°]"][2] == "3.2 by eq. 3.7"
    assert rows["reward in the simulation"][2].startswith("10.18 (8.21 to 12.10 in 8 runs)")
    assert rows["transitions collected"][1] == "200,000"


def test_what_is_estimated_is_told_from_what_is_measured():
    run = builders.run(small=True)
    spec = replace(run.spec, pressure_sensors=False, safe_supply=True)
    rows = beside_thesis(run.results, run.quality, run.test, run.transfer, spec).rows
    named = [row[0] for row in rows if "pressure" in row[0]]
    assert named
    assert all("estimated pressure" in name for name in named)
    measured, estimated = (adapted(run.adaptation, of).figures[0].alt for of in (run.spec, spec))
    assert "pressure 1" in measured
    assert "angle" in estimated
    assert "pressure" not in estimated


@pytest.mark.parametrize(
    ("closed_loop", "told"),
    [
        (39.9, "earns 38.10, planning with the arm's true physics 40.20"),
        (45.0, "earns 43.20, planning with the arm's true physics 45.00"),
    ],
)
def test_the_summary_names_the_better_of_the_two_bounds(closed_loop, told):
    results = builders.results()
    results["bound"]["distance"]["after"]["closed_loop"] = builders.below(closed_loop, 1.8)
    page = Page(
        run_page(RunData(ArmSpec(), results, test=movements(0), transfer=builders.transfer(counts=(3, 3, 3))))
    )
    assert f"In the first 150 movements after adaptation the controller {told}." in " ".join(page.text)


@pytest.mark.parametrize(("at_most", "told"), [({"at_most": 41.3}, True), ({"at_most": 40.2}, False), ({}, False)])
def test_the_bound_says_what_no_plan_exceeds_where_that_is_more(at_most, told):
    bound = builders.results()["bound"]
    bound["open_loop"] |= at_most
    assert ("No such sequences earn more than 41.30 in open loop." in bound_table(bound).caption) == told


def test_comparison_of_an_unfinished_run_leaves_out_what_is_not_known():
    table = beside_thesis({}, None, None, None, ArmSpec())
    assert all(row[1] == "–" for row in table.rows)


def test_text_of_people_is_escaped():
    html = render("<script>", ["a < b"], [Section("1 & 2", ["<b>"], tables=[Table(["x"], [["<i>"]], "&")])])
    page = Page(html)
    assert {"script", "b", "i"} & {tag for tag, _ in page.elements} == {"b"}  # the number of the table is bold
    assert "<i>" in page.text


def test_sections_of_the_same_title_are_refused():
    with pytest.raises(ValueError, match="must differ"):
        render("t", [], [Section("same"), Section("same")])


def save(folder, run):
    (folder / "results.json").write_text(json.dumps(run.results))
    write_spec(folder, run.spec)
    for record in (run.coverage, run.quality, run.training, run.marked):
        if record is not None:
            record.save(folder)
    run.test.save(folder / TEST)
    save_history(folder, run.adaptation)
    for number, shown in enumerate(run.demonstrations):
        save_demonstration(folder, shown, number)
    write_episodes(folder / "episodes.csv", run.transfer.phases)


@pytest.mark.parametrize("joints", [1, 2])
def test_what_a_run_leaves_in_its_folder_comes_back(tmp_path, joints):
    run = builders.run(joints, small=True)
    save(tmp_path, run)
    found = read_run(tmp_path)
    assert found.spec == run.spec
    records = [(found.coverage, run.coverage), (found.quality, run.quality), (found.training, run.training)]
    records += [(found.marked, run.marked), *zip(found.demonstrations, run.demonstrations, strict=True)]
    made = [(found.test, run.test), *zip(found.transfer.phases.values(), run.transfer.phases.values(), strict=True)]
    for back, sent in [*records, *made]:
        for name in Movements._fields if isinstance(sent, Movements) else sent.shapes():
            assert np.array_equal(getattr(back, name), getattr(sent, name)), name
    assert found.transfer.learning_rate == 0.05
    assert found.adaptation.events == run.adaptation.events
    np.testing.assert_array_equal(found.adaptation.squares, run.adaptation.squares)
    assert [m.end for m in found.demonstrations] == [m.end for m in run.demonstrations]


def test_write_report_writes_the_same_page_every_time(tmp_path):
    run = replace(builders.run(small=True), coverage=None, quality=None, training=None)
    save(tmp_path, run)
    path = write_report(tmp_path)
    assert path == tmp_path / "report.html"
    assert path.read_text(encoding="utf-8") == run_page(run)


def test_report_of_a_run_without_transfer(tmp_path):
    (tmp_path / "results.json").write_text("{}")
    write_spec(tmp_path, ArmSpec())
    builders.episodes(1, on_arm=False).save(tmp_path / TEST)
    page = Page(write_report(tmp_path).read_text(encoding="utf-8"))
    assert [a["id"] for t, a in page.elements if t == "section"] == [
        "section-the-thesis-task",
        "section-reward-and-the-thesis-figures-beside-ours",
    ]


def test_run_whose_arm_did_nothing_can_be_reported():
    run = RunData(ArmSpec(), {}, test=movements(0), transfer=builders.transfer(counts=(0, 0, 0)))
    assert "nan" not in " ".join(Page(run_page(run)).text)


@pytest.mark.parametrize(
    ("file", "content", "told"),
    [
        ("results.json", "not json", "expected the results of a finished run"),
        ("results.json", "[1]", "a JSON object; got list"),
        ("arm.json", "{}", "expected the spec of an arm"),
        ("arm.json", '{"angle_range": [0, 1023], "wings": 2}', "expected the spec of an arm"),
        ("episodes.csv", "phase,goal\n", "'actions'"),
        ("episodes.csv", ",".join(COLUMNS) + "\nbefore,x,0,1,2,2,0,1,0,50,1\n", "a cell is not what its column says"),
        ("episodes.csv", ",".join(COLUMNS) + "\nbefore,1 2,0,1,2,2,0,1,0,50,1\n", "goal of 2"),
        ("test_episodes.safetensors", "damaged", "this is something else"),
    ],
)
def test_unusable_files_are_named_with_what_to_do(tmp_path, file, content, told):
    (tmp_path / "results.json").write_text("{}")
    write_spec(tmp_path, ArmSpec())
    (tmp_path / file).write_text(content)
    with pytest.raises(UnusableInput, match=told) as caught:
        write_report(tmp_path)
    assert file in str(caught.value)
    assert not (tmp_path / "report.html").exists()


def test_a_file_of_another_record_is_refused(tmp_path):
    file = builders.coverage(10).save(tmp_path)
    with pytest.raises(UnusableInput, match="pneumarm movements"):
        Movements.load(file)


@pytest.mark.parametrize(
    ("make", "change"),
    [
        (builders.coverage, {"observation": np.zeros((5, 4))}),
        (builders.quality, {"target": np.zeros((3, 1, 4))}),
        (builders.quality, {"inputs": ("one",)}),
        (builders.training, {"chosen": 16}),
        (builders.training, {"evaluated": np.full(16, 99)}),
        (builders.movement, {"time": np.full(45, np.nan)}),
        (builders.marked, {"stages": ("collect",)}),
        (builders.marked, {"reasons": ("one",)}),
    ],
)
def test_records_refuse_arrays_that_do_not_fit(make, change):
    with pytest.raises(UnusableInput):
        replace(make(), **change)


def test_records_name_their_files():
    files = [r.file for r in (CoverageData, QualityData, TrainingData, Demonstration)]
    assert len(set(files)) == len(files)


def test_success_may_be_written_as_a_word(tmp_path):
    path = tmp_path / "episodes.csv"
    row = "after,600,1,2,500,601,0.2,10,1,33,{}\n"
    path.write_text(",".join(COLUMNS) + "\n" + row.format("True") + row.format("False"))
    assert read_episodes(path)["after"].success.tolist() == [True, False]


def test_the_distance_to_the_bound_is_told_or_why_it_is_not(html):
    text = " ".join(Page(html).text).replace("\u00a0", " ")
    assert "the controller earns 38.10, planning with the arm's true physics 40.20." in text
    assert "1.80 (1.30 to 2.30) of 39.90" in text
    assert "37.40 (37.03 to 37.47)" in text  # looking ahead
    unknown = {"bound": {"missing": "mine is no virtual arm: its true physics is not known"}}
    told = overview(RunData(ArmSpec(), unknown))
    assert "mine is no virtual arm" in told.text[-1]
    for results in (unknown, {}):
        assert len(overview(RunData(ArmSpec(), results)).tables) == len(overview(builders.run(small=True)).tables) - 1
