import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneumarm.arm.virtual import MuscleParameters, draw_parameters
from pneumarm.arm.virtual.constants import MUSCLE_CONSTANTS, _fill_muscle
from pneumarm.arm.virtual.muscle import braid, bring_to_length, compress, slip, static_tension
from pneumarm.arm.virtual.parameters import ATMOSPHERE, BAR
from pneumarm.arm.virtual.slow import adapt
from pneumarm.arm.virtual.start import place
from pneumarm.arm.virtual.state import MUSCLE
from pneumarm.arm.virtual.threshold import SOFTNESS, engage, threshold

# length [mm], weave angle [deg], diameter [mm], volume [ml], force per bar [N], stiffness per bar [N/m]
CLOSED_FORM = [
    (147, 54.7, 34.6, 138.5, 0.1, 1924),
    (160, 51.1, 33.0, 136.8, 26.2, 2094),
    (170, 48.1, 31.6, 133.1, 47.8, 2225),
    (180, 45.0, 30.0, 127.2, 70.7, 2356),
    (190, 41.7, 28.2, 119.0, 94.9, 2487),
    (200, 38.2, 26.2, 108.2, 120.4, 2618),
    (210, 34.4, 24.0, 94.8, 147.3, 2749),
    (220, 30.2, 21.3, 78.7, 175.4, 2880),
    (230, 25.4, 18.2, 59.7, 204.9, 3011),
    (240, 19.5, 14.1, 37.7, 235.6, 3142),
]
LENGTHS = st.floats(0.150, 0.246)
TIPS = st.floats(1.0, 1.3)


def record(parameters=None):
    """The muscle's constants as a kernel takes them."""
    constants = np.zeros(1, MUSCLE_CONSTANTS)
    _fill_muscle(constants[0], parameters or MuscleParameters())
    return constants[0]


def muscle_at(c, length, pressure, temperature=20.0):
    """A relaxed muscle at ``length`` [m] and gauge ``pressure`` [Pa]."""
    muscle = np.zeros(1, MUSCLE)[0]
    place(muscle, c, length)
    muscle["temperature"] = temperature
    adapt(muscle, c)
    muscle["pressure"] = ATMOSPHERE + pressure
    bring_to_length(muscle, c, length, 0.0, ATMOSPHERE, 1.2, 0.0)
    return muscle


@pytest.mark.parametrize(("length", "weave", "diameter", "volume", "force", "stiffness"), CLOSED_FORM)
def test_braid_has_the_closed_form_of_the_ideal_muscle(length, weave, diameter, volume, force, stiffness):
    c = record()
    pull, enclosed = braid(c, length / 1e3)
    assert pull * BAR == pytest.approx(force, abs=0.06)
    assert enclosed * 1e6 == pytest.approx(volume, abs=0.06)
    step = 1e-6
    slope = (braid(c, length / 1e3 + step)[0] - braid(c, length / 1e3 - step)[0]) / (2 * step)
    assert slope * BAR == pytest.approx(stiffness, abs=1)
    # The volume is that of a cylinder whose strands keep their length.
    cosine = length / 180 * math.cos(math.radians(45))
    assert math.degrees(math.acos(cosine)) == pytest.approx(weave, abs=0.06)
    assert 30 * math.sqrt(1 - cosine**2) / math.sin(math.radians(45)) == pytest.approx(diameter, abs=0.06)
    assert enclosed == pytest.approx(math.pi / 4 * (diameter / 1e3) ** 2 * length / 1e3, rel=0.01)


def test_the_data_sheet_of_the_thesis_lies_within_the_stroke():
    c = record()
    for kilograms, length in ((35, 0.191), (70, 0.227)):  # at 3.5 bar
        assert braid(c, length)[0] * 3.5 * BAR == pytest.approx(kilograms * 9.81, rel=0.02)


@given(LENGTHS, TIPS)
def test_pull_is_the_slope_of_the_volume(length, tip):
    c = record(replace(MuscleParameters(), tip=tip))
    step = 1e-5
    slope = (braid(c, length + step)[1] - braid(c, length - step)[1]) / (2 * step)
    assert braid(c, length)[0] == pytest.approx(-slope, abs=2e-8)


def test_the_tip_changes_only_the_contracted_muscle():
    plain, tipped = record(), record(replace(MuscleParameters(), tip=1.25))
    assert braid(tipped, 0.2) == pytest.approx(braid(plain, 0.2), rel=1e-12)
    assert braid(tipped, 0.16)[0] < braid(plain, 0.16)[0]


@settings(deadline=None)
@given(st.floats(-0.5 * BAR, BAR))
def test_the_soft_threshold_is_the_logarithm_it_stands_for(above):
    engaged, engagement = engage(above)
    z = above / SOFTNESS
    assert engaged == pytest.approx(SOFTNESS * (max(z, 0) + math.log1p(math.exp(-abs(z)))), abs=2e-6 * SOFTNESS)
    assert engagement == pytest.approx(1 / (1 + math.exp(-z)) if z > -500 else 0.0, abs=2e-5)


@settings(deadline=None)
@given(st.floats(-0.2 * BAR, 0.2 * BAR))
def test_engagement_is_the_slope_of_the_engaged_pressure(above):
    step = 0.01
    slope = (engage(above + step)[0] - engage(above - step)[0]) / (2 * step)
    assert engage(above)[1] == pytest.approx(slope, abs=1e-4)


def test_the_threshold_grows_with_the_gap_and_ends():
    c, at_rest = record(), 0.05 * BAR
    assert threshold(at_rest, c, 0.180) == pytest.approx(at_rest)
    lengths = np.linspace(0.147, 0.254, 50)
    values = np.array([threshold(at_rest, c, length) for length in lengths])
    assert (np.diff(values) <= 1e-9).all()
    assert values[-1] == 0
    assert values.max() <= 2 * at_rest


@given(LENGTHS, st.floats(0, 1.2), st.integers(0, 20))
@settings(deadline=None)
def test_reciprocity(length, bar, seed):
    """dF/dp at a length is -dV/dl as the pressure feels it, at the threshold too: no energy comes from nothing."""
    c = record(draw_parameters(seed).joints[0].muscles[0])
    muscle = muscle_at(c, length, bar * BAR)
    step = 1.0
    pushed = [static_tension(c, bar * BAR + sign * step, length) for sign in (-1, 1)]
    by_pressure = (pushed[1] - pushed[0]) / (2 * step)
    # What a small closed change of length does to the pressure gives dV/dl back: dp = -n p s dV / (V + Vd).
    stretch, polytropic = 1e-7, 1.2
    before = muscle["pressure"]
    compress(muscle, c, braid(c, length + stretch)[1], 0.0, polytropic)
    felt = -(muscle["pressure"] - before) / (polytropic * before) * (muscle["volume"] + c["dead_volume"]) / stretch
    if pushed[0] > 0:  # a slack muscle does not pull at all
        assert by_pressure == pytest.approx(-felt, abs=2e-7 + 1e-4 * abs(felt))


@settings(deadline=None)
@given(LENGTHS, LENGTHS, st.floats(0.4, 1.1), st.floats(1.0, 1.4))
def test_a_closed_muscle_keeps_p_v_to_the_n(start, end, bar, polytropic):
    c = record(replace(MuscleParameters(), leak=0.0, seat_leak=0.0))
    muscle = muscle_at(c, start, bar * BAR)
    kept = []
    for length in np.linspace(start, end, 200):
        bring_to_length(muscle, c, length, 0.0, ATMOSPHERE, polytropic, 1e-3)
        # Above the threshold, where the bladder follows the braid.
        if muscle["engagement"] == 1.0:
            kept.append(muscle["pressure"] * (muscle["volume"] + c["dead_volume"]) ** polytropic)
    assert len(kept) > 0
    assert np.allclose(kept, kept[0], rtol=2e-4)


def test_the_volume_law_is_of_third_order():
    c = record(replace(MuscleParameters(), leak=0.0, seat_leak=0.0))
    errors = []
    for steps in (2, 4, 8):
        muscle = muscle_at(c, 0.17, BAR)
        first = muscle["pressure"] * (muscle["volume"] + c["dead_volume"]) ** 1.2
        for length in np.linspace(0.17, 0.22, steps + 1)[1:]:
            bring_to_length(muscle, c, length, 0.0, ATMOSPHERE, 1.2, 0.0)
        errors.append(abs(muscle["pressure"] * (muscle["volume"] + c["dead_volume"]) ** 1.2 / first - 1))
    assert errors[0] > 3 * errors[1] > 9 * errors[2]


def slip_path(c, lengths, bar=0.5):
    """The friction's pull along a path of lengths [m] at a constant pressure."""
    muscle = muscle_at(c, lengths[0], bar * BAR)
    return np.array([slip(muscle, c, stretch) for stretch in np.diff(lengths)])


def test_dry_friction_loses_energy_and_is_bounded():
    c = record()
    random = np.random.default_rng(0)
    steps = np.concatenate([[0.0], random.normal(0, 5e-4, 2000)])
    muscle = muscle_at(c, 0.19, 0.5 * BAR)
    capacity = muscle["friction"] + muscle["friction_per_pressure"] * muscle["engaged"]
    stored = work = 0.0
    for stretch in steps:
        before = muscle["slip"].copy()
        force = slip(muscle, c, stretch)
        assert abs(force) <= capacity * (1 + 1e-12)
        # By the trapezoidal rule per element, so that sticking elements store exactly what is put in.
        work += float(((before + muscle["slip"]) / 2).sum()) * stretch
        stored = float((muscle["slip"] ** 2 / (2 * capacity * c["slip_rates"])).sum())
    assert work > 10 * stored > 0


def test_minor_loops_lie_inside_the_major_loop_and_close():
    c = record()
    major = np.concatenate([np.linspace(-0.01, 0.01, 400), np.linspace(0.01, -0.01, 400)])
    minor = np.concatenate([np.linspace(-0.01, 0.003, 260), np.linspace(0.003, -0.003, 120)])
    minor = np.concatenate([minor, np.linspace(-0.003, 0.003, 120)])
    outer, inner = slip_path(c, 0.19 + major), slip_path(c, 0.19 + minor)
    loading = np.interp(minor[1:], major[1:400], outer[:399])
    back = np.interp(minor[1:], major[:399:-1], outer[:398:-1])
    tolerance = 0.02  # of reading a broken line between its samples [N]
    assert (inner <= loading + tolerance).all()
    assert (inner[260:] >= back[260:] - tolerance).all()
    # Return-point memory: back where it turned, the loop closes.
    assert inner[-1] == pytest.approx(inner[258], rel=1e-6)


def test_friction_depends_on_the_pressure_and_not_on_the_rate():
    c = record()
    low, high = (slip_path(c, np.linspace(0.19, 0.2, 50), bar)[-1] for bar in (0.1, 1.0))
    assert 2 * low < high
    coarse = slip_path(c, np.linspace(0.19, 0.2, 5), 0.5)[-1]
    assert coarse == pytest.approx(slip_path(c, np.linspace(0.19, 0.2, 500), 0.5)[-1], rel=1e-9)


def test_a_muscle_only_pulls_and_jams_at_its_end():
    c = record()
    assert 0 <= static_tension(c, 0.0, 0.150) < 1e-3
    assert static_tension(c, 0.0, 0.140) >= 0
    assert static_tension(c, 0.0, 0.250) > 25.0
    assert static_tension(c, BAR, 0.147) < 1.0


def test_warmth_changes_the_muscle():
    c = record()
    cold, warm = muscle_at(c, 0.2, 0.0, 15.0), muscle_at(c, 0.2, 0.0, 25.0)
    assert warm["friction"] < cold["friction"]
    assert warm["viscosity"] < cold["viscosity"]
    assert warm["bladder_length"] > cold["bladder_length"]
    assert warm["threshold"] < cold["threshold"]
    assert cold["bladder_stiffness"] < warm["bladder_stiffness"]
