from dataclasses import asdict, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pneumarm.arm import ArmSpec, open_arm
from pneumarm.arm.corrected import CorrectedArm
from pneumarm.arm.spec_file import ArmFile, SensorCorrection, load_arm_file, load_spec, save_arm_file, save_spec
from pneumarm.errors import UnusableInput

positive = st.floats(1e-3, 1e5)


@given(
    st.integers(1, 9),
    st.floats(1e-3, 10),
    positive,
    positive,
    st.floats(-1e4, 0),
    positive,
    st.text(st.characters(exclude_characters="\0", codec="utf-8"), max_size=30),
)
def test_a_spec_comes_back_as_it_was(tmp_path_factory, joints, period, per_degree, per_bar, low, span, name):
    spec = ArmSpec(
        joints, period, per_degree, per_bar, (low, low + span), latency=period / 3, links=(0.2,) * joints, name=name
    )
    path = tmp_path_factory.mktemp("spec") / "arm.toml"
    save_spec(spec, path)
    assert load_spec(path) == spec


def test_corrections_come_back_and_correct(tmp_path, smallest_arm):
    table = ((0.0, 100.0, 300.0), (10.0, 60.0, 400.0))
    correction = SensorCorrection(((40.0, 42.0),), ((1.0, 0.5),), (table[0],), (table[1],))
    path = tmp_path / "arm.toml"
    save_arm_file(ArmFile(ArmSpec(), correction), path)
    assert load_arm_file(path) == ArmFile(ArmSpec(), correction)
    arm = smallest_arm()
    arm.pressure = [[140, 142]]
    corrected = CorrectedArm(arm, load_arm_file(path))
    for raw, true in ((0, 10), (50, 35), (100, 60), (200, 230), (400, 570), (-100, -40)):
        arm.angle = [raw]
        reading = corrected.read()
        assert reading.angle == pytest.approx([true])
        assert reading.pressure.tolist() == [[100, 50]]
    assert SensorCorrection().is_none
    assert not correction.is_none


WRONG = {
    "": "spec",
    "[spec]\njoints = 0": "joints",
    "[spec]\njoints = true": "joints",
    "[spec]\nperiod = nan": "period",
    "[spec]\ncolour = 3": "colour is unknown; known are joints",
    "[spec]\n[spce]": "spce is unknown",
    "[spec]\nangle_range = [3]": "angle_range",
    "[spec]\n[correction]\npressure_zero = [[1.0, inf]]": "pressure_zero",
    "[spec]\n[correction]\npressure_zero = [[1.0, 1.0], [1.0, 1.0]]": "1 joint",
    "[spec]\n[correction]\nangle_raw = [[2.0, 1.0]]\nangle_true = [[1.0, 2.0]]": "angle_raw needs at least two",
    "[spec]\n[correction]\nangle_raw = [[2.0, 3.0]]": "angle_true needs as many tables",
    "x = " + "[" * 5000: "",
    "x = 1 # " + "y" * (1 << 18): "larger than",
    "\x00": "",
}


@pytest.mark.parametrize("text", WRONG, ids=range(len(WRONG)))
def test_what_is_not_known_or_not_possible_is_refused_with_the_files_name(tmp_path, text):
    path = tmp_path / "arm.toml"
    path.write_text(text)
    with pytest.raises(UnusableInput, match=f"arm.toml: .*{WRONG[text]}"):
        load_spec(path)


def test_a_missing_file_and_a_missing_folder_are_refused(tmp_path):
    with pytest.raises(UnusableInput, match="cannot be read"):
        load_spec(tmp_path / "none.toml")
    with pytest.raises(UnusableInput, match="does not exist"):
        save_spec(ArmSpec(), tmp_path / "none" / "arm.toml")


def test_an_arm_is_opened_with_its_file(tmp_path):
    path = tmp_path / "arm.toml"
    with open_arm("virtual:seed=4") as plain:
        known = ArmFile(
            replace(plain.spec, period=0.05, name="mine"), SensorCorrection(pressure_zero=((10.0, 20.0),))
        )
        expected = plain.read()
    save_arm_file(known, path)
    for arm in (open_arm("virtual:seed=4", spec=path), open_arm(f"virtual:seed=4,spec={path}")):
        with arm:
            assert arm.spec == known.spec
            assert np.array_equal(arm.read().pressure, expected.pressure - [[10, 20]])
    save_spec(replace(known.spec, joints=2, links=()), path)
    with pytest.raises(UnusableInput, match=r"2 joint\(s\), this has 1"):
        open_arm(f"virtual,spec={path}")
    assert "name" in asdict(known.spec)
