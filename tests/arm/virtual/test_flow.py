import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneumarm.arm.virtual import MuscleParameters
from pneumarm.arm.virtual.constants import MUSCLE_CONSTANTS, _fill_muscle
from pneumarm.arm.virtual.flow import flow_function, free_air
from pneumarm.arm.virtual.parameters import ATMOSPHERE, BAR

PRESSURES = st.floats(0.5 * BAR, 8 * BAR)


def record(critical_ratio=0.3):
    constants = np.zeros(1, MUSCLE_CONSTANTS)
    _fill_muscle(constants[0], MuscleParameters(critical_ratio=critical_ratio))
    return constants[0]


@pytest.mark.parametrize(("b", "conductance"), [(0.2, 0.417), (0.3, 0.393), (0.4, 0.367), (0.5, 0.340)])
def test_the_conductance_of_a_valve_of_100_litres_a_minute(b, conductance):
    """100 l/min from 6 to 5 bar gauge; the conductance in l/(s bar) for each critical ratio."""
    flow = free_air(conductance * 1e-8, 6 * BAR + ATMOSPHERE, 5 * BAR + ATMOSPHERE, record(b))
    assert flow * 60e3 == pytest.approx(100, rel=2e-3)


def test_choked_flow_is_conductance_times_pressure():
    c = record()
    assert free_air(2e-9, 4 * BAR, 1.0 * BAR, c) == pytest.approx(2e-9 * 4 * BAR)
    assert free_air(2e-9, 4 * BAR, 0.1 * BAR, c) == free_air(2e-9, 4 * BAR, 1.0 * BAR, c)


def test_subsonic_spot_value():
    ratio = 0.8
    expected = math.sqrt(1 - ((0.8 - 0.3) / 0.7) ** 2)
    assert flow_function(ratio, record()) == pytest.approx(expected, rel=1e-12)


def test_the_flow_function_has_no_steps():
    c = record()
    for ratio in (0.3, 0.999):
        assert flow_function(ratio - 1e-9, c) == pytest.approx(flow_function(ratio + 1e-9, c), abs=1e-6)
    values = [flow_function(ratio, c) for ratio in np.linspace(0, 1, 2001)]
    assert (np.diff(values) <= 0).all()
    assert values[-1] == 0


@settings(deadline=None)
@given(PRESSURES, PRESSURES)
def test_air_runs_from_high_to_low_either_way_alike(source, sink):
    c = record()
    flow = free_air(1e-9, source, sink, c)
    assert flow == -free_air(1e-9, sink, source, c)
    assert math.copysign(1, flow) == math.copysign(1, source - sink) or flow == 0
    assert abs(flow) <= 1e-9 * max(source, sink)
