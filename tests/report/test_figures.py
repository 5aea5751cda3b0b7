import functools
import re

import builders
import numpy as np
import pytest

from pneumarm.arm import ArmSpec
from pneumarm.drawing.colours import DARK, LIGHT, MIDDLE
from pneumarm.report.figures.adaptation import CurveMark, adaptation_curves
from pneumarm.report.figures.baselines import Baseline, baselines
from pneumarm.report.figures.coverage import cells, new_share, projections
from pneumarm.report.figures.displacement import against_displacement
from pneumarm.report.figures.film import movement
from pneumarm.report.figures.importance import input_importance
from pneumarm.report.figures.isoplots import isoplot
from pneumarm.report.figures.marked import marked_rows
from pneumarm.report.figures.propagation import error_propagation, expectation
from pneumarm.report.figures.residues import Classification, residue_by_class, residues
from pneumarm.report.figures.training import training_curves
from pneumarm.report.figures.transfer import transfer_curves
from pneumarm.report.sections import RunData, all_sections, classifications, levels, phases_of
from pneumarm.report.style import svg
from pneumarm.statistics import Estimate
from pneumarm.task.movements import movements

SPEC = ArmSpec()

SIZES = {"one": 1, "none": 0}


@functools.cache
def figures_of(n, joints):
    """Every figure of the report from ``n`` samples, by name."""
    spec = ArmSpec(joints=joints)
    seen, q = builders.coverage(n, joints), builders.quality(n, joints, steps=min(n, 30))
    t = builders.training(agents=min(n, 16), evaluations=min(n, 44)) if n else None
    test = builders.episodes(n, joints, on_arm=False)
    phases = phases_of(builders.transfer(joints, (n, n, n)))
    won = test.success
    far = (test.distance[won], test.actions[won], test.all_switches[won])
    real, simulated = q.target - q.observation, q.predicted - q.observation
    adapted = builders.adaptation(n, joints)
    marks = [CurveMark(event.movement, event.what) for event in adapted.events]
    m = builders.movement(joints=joints, n=max(n // 8, 1))
    k = builders.marked(n, builders.marked().reasons if n else ())
    made = {
        "projections": projections(seen.observation, spec),
        "cells": cells(seen.cells_holding, 5, seen.growth),
        "residue": residues(q.target[:, :, 0], q.predicted[:, :, 0], spec),
        "residue_by_class": residue_by_class(simulated[:, 0, 0], classifications(q, 0, spec)),
        "isoplot": isoplot(real, simulated, spec),
        "propagation": error_propagation(q.propagation, spec),
        "importance": input_importance(q.weights, q.inputs, q.outputs),
        "transfer": transfer_curves(phases, levels(test)),
        "displacement": against_displacement(*far, spec),
        "baselines": baselines(*(builders.baselines(min(n, 10)) if n else ([], {}))),
        "adaptation": adaptation_curves(adapted.squares, adapted.quantities, marks, 1.14),
        "marked": marked_rows(k.spans, k.reason, k.reasons, k.ends.tolist(), k.stages, spec.period),
        "movement": movement(m.shown(spec), m.seconds, tolerance=25.0),
    }
    if t is not None:
        made["shaping"] = training_curves(t.curves, t.columns, t.evaluated, t.chosen, spec)
        learned = t.curves[:, :, [0, 3, 4]]
        made["learning"] = training_curves(learned, ("episodes", "reward", "success"), t.evaluated, t.chosen, spec)
    return made


@pytest.mark.parametrize("joints", [1, 2])
def test_every_axis_is_labelled_with_its_unit(joints):
    for name, figure in figures_of(400, joints).items():
        figure.draw_without_rendering()
        for axes in (a for a in figure.axes if a.get_visible() and a.axison):
            labels = []
            for axis in (axes.xaxis, axes.yaxis):
                shown = axis.get_visible() and any(t.get_text() for t in axis.get_ticklabels() if t.get_visible())
                if shown:
                    labels.append(axis.get_label_text())
            for label in labels:
                named = {
                    "valves",
                    "input",
                    "observations",
                    "transitions",
                    "action (valves of muscle 1, 2)",
                    "marked for",
                }
                assert re.search(r"\[.+\]", label) or label in named, f"{name}: {label!r}"


@pytest.mark.parametrize("size", SIZES.values(), ids=SIZES.keys())
def test_every_figure_can_be_drawn_from_one_and_no_samples(size):
    for name, figure in figures_of(size, 1).items():
        drawn = svg(figure)
        assert drawn.startswith("<?xml"), name
        assert "nan" not in re.findall(r'[ ="](nan)[ ",]', drawn), name


def test_no_axis_label_is_cut_off_and_no_two_labels_lie_on_each_other():
    for joints in (1, 2):
        for name, figure in figures_of(400, joints).items():
            figure.draw_without_rendering()
            renderer, width, height = figure.canvas.get_renderer(), *figure.bbox.size
            boxes = []
            for axes in (a for a in figure.axes if a.get_visible()):
                for text in (axes.xaxis.label, axes.yaxis.label, axes.title, axes._left_title):
                    if text.get_text() and text.get_visible():
                        boxes.append((text.get_text(), text.get_window_extent(renderer)))
            for words, box in boxes:
                inside = box.x0 >= -1 and box.y0 >= -1 and box.x1 <= width + 1 and box.y1 <= height + 1
                assert inside, f"{name}: {words!r} is cut off"
            for i, (words, box) in enumerate(boxes):
                for others, other in boxes[i + 1 :]:
                    overlap = (
                        min(box.x1, other.x1) - max(box.x0, other.x0),
                        min(box.y1, other.y1) - max(box.y0, other.y0),
                    )
                    assert min(overlap) < 1, f"{name} for {joints} joints: {words!r} lies on {others!r}"


def test_the_inks_can_be_told_apart_in_grey():
    def lightness(color):
        linear = [((c := int(color[i : i + 2], 16) / 255) <= 0.04045 and c / 12.92) or ((c + 0.055) / 1.055) ** 2.4
                  for i in (1, 3, 5)]  # fmt: skip
        luminance = float(np.dot(linear, (0.2126, 0.7152, 0.0722)))
        return 116 * luminance ** (1 / 3) - 16

    dark, middle, light = (lightness(c) for c in (DARK, MIDDLE, LIGHT))
    assert middle - dark > 20
    assert light - middle > 18


def test_drawing_leaves_the_style_of_others_alone():
    import matplotlib

    before = dict(matplotlib.rcParams)
    svg(cells(np.array([0, 3, 4]), 5, np.empty((0, 2), np.int64)))
    assert dict(matplotlib.rcParams) == before


def test_same_arrays_give_the_same_svg():
    arrays = builders.movement(), builders.coverage(500)
    made = []
    for _ in range(2):
        m, c = arrays
        pair = (
            movement(m.shown(SPEC), m.seconds, tolerance=25.0),
            projections(c.observation, SPEC),
        )
        made.append([svg(f) for f in pair])
    assert made[0] == made[1]
    assert all("<dc:date>" not in text for text in made[0])


def test_isoplot_shows_the_bias_of_a_simulation_that_predicts_too_little():
    random = np.random.default_rng(0)
    real = random.normal(0, 10, (500, 1, 4))
    figure = isoplot(real, 0.5 * real, SPEC)
    assert [t.get_text() for t in figure.axes[0].get_legend().get_texts()] == ["ideal, 45°", "slope 0.500"]
    assert "angle: slope 0.500" in figure.alt


def test_expected_propagation_is_equation_3_7_with_the_thesis_numbers():
    # Table 5.2: 6.70 counts become 36.70 after one second at 30 Hz.
    measured = np.zeros((30, 1, 4))
    measured[0, 0] = (6.70, 0.19, 1.94, 1.52)
    assert np.allclose(expectation(measured)[-1, 0, (0, 2, 3)], (36.70, 10.63, 8.33), atol=0.01)


def test_residue_by_class_tells_where_the_simulation_is_unsure():
    random = np.random.default_rng(0)
    velocity = random.uniform(-3, 3, 9000)
    residue = random.normal(0, 1 + np.abs(velocity))
    text = residue_by_class(residue, [Classification("velocity [°/s]", velocity)]).alt
    least, where_least, most, where_most = (
        float(v) for v in re.search(r"from ([\d.]+)° \(at (\S+)\) to ([\d.]+)° \(at (\S+)\)", text).groups()
    )
    assert least < 1.5 < 3.2 < most
    assert abs(where_least) < 0.5 < 2 < abs(where_most)


def test_growth_of_coverage_is_the_thesis_test_for_enough_data():
    assert new_share(np.array([[100, 50], [200, 80], [400, 80]])) == 0
    assert new_share(np.array([[0, 0], [400, 80]])) == pytest.approx(0.5)


def test_cells_counts_every_occupied_cell_once():
    held = np.bincount(np.random.default_rng(0).geometric(0.02, 3000))
    figure = cells(held, 5, np.empty((0, 2), np.int64))
    assert sum(bar.get_height() for bar in figure.axes[0].patches) == 3000


def test_movement_marks_goal_and_valves():
    m = builders.movement()
    figure = movement(m.shown(SPEC), m.seconds, tolerance=25.0)
    _arm, angle, _pressure, valves = figure.axes
    (legend,) = figure.legends
    assert [t.get_text() for t in legend.get_texts()] == ["angle", "asked for", "muscle 1", "muscle 2"]
    assert [t.get_text() for t in valves.get_yticklabels()] == ["2", "1"]
    (band,) = angle.collections
    low, high = band.get_datalim(angle.transData).intervaly
    assert (low + high) / 2 == pytest.approx(SPEC.degrees(m.goal[0]))
    assert high - low == pytest.approx(50 / SPEC.counts_per_degree)
    alt = figure.alt
    assert "goes from -30.0° to a goal of 40.0°" in alt
    assert "reached after 0.73 s, with 6 valve changes" in alt


def test_transfer_curve_passes_through_the_mean_and_marks_the_simulation():
    phases = phases_of(builders.transfer(counts=(50, 0, 0)))
    figure = transfer_curves(phases, {"reward": 12.5}, window=101)
    curve = next(line for line in figure.axes[0].lines if len(line.get_xdata()) == 50)
    assert np.allclose(curve.get_ydata(), phases[0].reward.mean())
    assert any(np.allclose(line.get_ydata(), 12.5) for line in figure.axes[0].lines if len(line.get_ydata()))


def test_a_run_without_anything_has_its_results_only():
    sections = all_sections(RunData(SPEC, {}, test=movements(0)))
    assert [s.title for s in sections] == ["The thesis' task", "Reward, and the thesis' figures beside ours"]


def test_rewards_far_below_are_cut_off_but_never_those_of_the_best_method():
    def method(name, *rewards):
        mean = float(np.mean(rewards))
        interval = Estimate(mean, mean - 9, mean + 9, 9)
        return Baseline(name, np.full(len(rewards), 50.0), np.array(rewards), interval)

    spread, bad = method("spread", -33.0, -107.0), method("bad", -300.0)
    assert baselines([spread, bad], {}).axes[0].get_ylim() == (-109.0, -31.0)
    good = method("good", 30.0, 28.0)
    assert baselines([good, spread], {}).axes[0].get_ylim() == (-17.0, 32.0)


def test_baselines_stand_at_their_rewards_beside_the_bound():
    trained, untrained = builders.baselines()
    figure = baselines(trained, untrained)
    place = figure.axes[0]
    drawn = {(x, y) for line in place.lines for x, y in zip(line.get_xdata(), line.get_ydata(), strict=True)}
    for baseline in trained:
        assert set(zip(baseline.seconds, baseline.reward, strict=True)) <= drawn
        assert baseline.mean.mean in {y for _, y in drawn}
    assert {level.mean for level in untrained.values()} <= {y for _, y in drawn}
    low, high = place.get_ylim()
    assert low < min(baseline.reward.min() for baseline in trained) < 40.2 < high
    assert "open loop: 40.20 without training" in figure.alt
    assert baselines([], {}).alt == "Reward against training time. No baseline was measured."


def test_the_adaptation_is_told_with_its_figures():
    adapted = builders.adaptation()
    marks = [CurveMark(event.movement, event.what) for event in adapted.events]
    words = adaptation_curves(adapted.squares, adapted.quantities, marks, 1.14).alt
    first = np.sqrt(adapted.squares[:100, 1, 0].mean())
    assert f"angle {first:.2f} in the first hundred" in words
    assert words.endswith(
        "change noticed after movement 46; new version after movement 60; version rolled back after movement 100."
    )
