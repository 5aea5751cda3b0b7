"""The section on what was found wrong."""

import json

import builders

from pneumarm.arm import ArmSpec
from pneumarm.control.condition import complaints
from pneumarm.report.health import findings, health
from pneumarm.report.run_report import read_run

SPEC = ArmSpec()


def test_nothing_wrong_is_one_sentence():
    section = health({"collect": builders.found(), "transfer": builders.found()}, builders.marked(0, ()), SPEC)
    assert list(section.text) == [
        "The monitor found nothing wrong, and no row is marked; no decision had to be replaced, no control period "
        "began late."
    ]
    assert not section.figures
    (table,) = section.tables  # inlets are kept closed on any arm
    assert [row[0] for row in table.rows] == ["inlets kept closed, the muscle read over its limit"]


def test_every_finding_is_told_with_place_time_and_marked_rows():
    run = builders.run(small=True)
    section = health(run.results, run.marked, SPEC)
    assert "found 2 things wrong" in section.text[0]
    assert "6 decisions had to be replaced, 14 control periods began late" in section.text[0]
    found, counts, link = section.tables
    assert list(map(tuple, found.rows)) == [
        ("stuck valve: the inlet is stuck closed", "joint 1, muscle 2", "collecting", "59.5 s", "60.4 s", "82.6 s",
         "474"),
        ("low supply: the supply is gone", "the whole arm", "moving", "602.7 s", "602.9 s", "lasts", "474"),
    ]  # fmt: skip
    assert counts.header == ("", "collecting", "on arrival", "after adaptation")
    assert ("control periods that began late", "0", "7", "7") in counts.rows
    assert ("requests answered", "0", "9,000", "9,000") in link.rows
    assert "2,000 rows between" in section.figures[0].alt
    assert len(findings(run.results)) == 2


def test_results_of_older_versions_are_told_as_far_as_they_go():
    section = health({"transfer": {"findings": ["leak: joint 1 (a large leak) since 3.0 s"]}}, None, SPEC)
    assert section.tables[0].rows[0][0] == "leak: joint 1 (a large leak) since 3.0 s"
    assert "was not recorded" in section.text[0]
    assert complaints({"findings": ["text"]}, "moving") == []


def test_commands_tell_what_was_found_and_not_what_any_arm_does():
    assert complaints(builders.found(), "collecting") == []
    results = json.loads(json.dumps(builders.found(builders.FOUND, late=3, missed=2)))
    assert complaints(results, "moving") == [
        f"found while moving: {builders.FOUND}; 474 rows are marked and nothing is learned from them",
        "guard while moving: 30 x pressure, 3 x late, 1 x vented",
        "late while moving: 2 control periods",
    ]


def test_a_run_of_a_healthy_arm_says_so(small_run):
    run = read_run(small_run)
    assert health(run.results, run.marked, run.spec).text[0].startswith("The monitor found nothing wrong, and no row")
    assert set(run.results["transfer"]["counts"]) == {"before", "learning", "after"}
    assert run.results["collect"]["counts"]["collecting"]["interventions"]["pressure"] > 0
    assert run.results["collect"]["findings"] == run.results["transfer"]["findings"] == []
