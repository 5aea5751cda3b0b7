import itertools
from dataclasses import replace

import numpy as np
import pytest

from pneumarm.arm import open_arm
from pneumarm.arm.open import shape_of
from pneumarm.arm.spec_file import save_spec
from pneumarm.arm.virtual import VirtualArm, draw_parameters, draw_wide, preset_parameters
from pneumarm.errors import ArmFailure, UnusableInput

USER = """
from pneumarm.arm.virtual import VirtualArm

def mine():
    return VirtualArm(name="mine")

def nothing():
    return 3


def unplugged():
    raise OSError(2, "No such file or directory", "/dev/ttyACM9")
"""


def test_virtual_arms_by_name():
    assert isinstance(open_arm("virtual"), VirtualArm)
    assert open_arm("virtual:seed=7").parameters == draw_parameters(7)
    assert open_arm("virtual:seed=7").spec.name == "virtual:seed=7"
    assert open_arm("virtual:preset=A").parameters == preset_parameters("A")
    wide = open_arm("virtual:wide,seed=7")
    assert wide.parameters == draw_wide(7)
    assert (wide.spec.name, wide.spec.period) == ("virtual:wide,seed=7", draw_wide(7).period)
    assert open_arm("virtual:seed=7,rate=50,wide").spec.period == 0.02
    whole = open_arm("virtual:seed=7,pulses=off")
    assert whole.parameters == open_arm("virtual:seed=7").parameters
    assert whole.spec.possible(np.array([[0.6, -0.2]])).tolist() == [[1.0, 0.0]]
    assert open_arm("virtual", seed=1).get_state() != open_arm("virtual", seed=2).get_state()


def test_a_users_arm(tmp_path, monkeypatch):
    (tmp_path / "their_arm.py").write_text(USER)
    monkeypatch.syspath_prepend(str(tmp_path))
    assert open_arm("python:their_arm:mine").spec.name == "mine"
    with pytest.raises(UnusableInput, match="it returned int"):
        open_arm("python:their_arm:nothing")
    with pytest.raises(UnusableInput, match="expected a module and a callable"):
        open_arm("python:their_arm:absent")
    with pytest.raises(ArmFailure, match=r"cannot be opened \(FileNotFoundError: .*ttyACM9"):
        open_arm("python:their_arm:unplugged")
    (tmp_path / "broken_arm.py").write_text("def mine(:")
    with pytest.raises(UnusableInput, match=r"broken_arm cannot be imported \(SyntaxError"):
        open_arm("python:broken_arm:mine")


@pytest.mark.parametrize(
    "name", ["", "robot", "virtual:seed=x", "virtual:seed=-1", "virtual:wide", "virtual:color=red", "simulation:"]
)
def test_unknown_names_are_refused_with_what_is_expected(name):
    with pytest.raises(UnusableInput, match="expected virtual, virtual:seed=7"):
        open_arm(name)


def test_an_unknown_preset_is_refused():
    with pytest.raises(UnusableInput, match="preset 'Z': expected one of A, B, C"):
        open_arm("virtual:preset=Z")


def test_options_come_in_any_order(tmp_path):
    plan, known = tmp_path / "a,plan.toml", tmp_path / "arm.toml"
    plan.write_text('[[fault]]\nkind = "supply-loss"\n')
    with open_arm("virtual:seed=7,sensors=velocity") as arm:
        save_spec(arm.spec, known)
    for options in itertools.permutations(("seed=7", f"faults={plan}", "sensors=velocity", f"spec={known}")):
        with open_arm(f"virtual:{','.join(options)}") as arm:
            assert arm.arm.parameters == draw_parameters(7)
            assert arm.spec.velocity_sensor
            assert len(arm.arm.faults) == 1
    with open_arm(f"virtual:spec={known}") as arm:
        assert arm.arm.parameters == VirtualArm().parameters


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("virtual:seed=7,seed=8", "an option is given twice"),
        ("virtual:seed=7,preset=A", "expected virtual"),
        ("virtual:seed=7,pulses=maybe", "pulses is on or off, not 'maybe'"),
        ("python:tests.plain_arms:linear,pulses=off", "only a virtual arm has pulses;"),
        ("virtual:seed=7,sensors=", "expected further sensors of velocity"),
        ("serial:/dev/nowhere,sensors=velocity", "only a virtual arm has sensors;"),
        ("simulation:FILE,faults=plan.toml,seed=3", "only a virtual arm has faults, seed;"),
    ],
)
def test_options_that_cannot_be_are_refused(name, said):
    with pytest.raises(UnusableInput, match=said):
        open_arm(name)


@pytest.mark.parametrize(
    "name",
    [
        "virtual",
        "virtual:seed=7",
        "virtual:preset=A",
        "virtual:wide,seed=3",
        "virtual:joints=2,seed=1,coupling=0.5",
        "virtual:seed=7,sensors=velocity+acceleration",
        "virtual:seed=7,pressure_sensors=off,pulses=off",
        "virtual:seed=7,muscles=1,rate=200",
    ],
)
def test_what_a_virtual_arm_reads_and_is_told_is_known_without_opening_it(name):
    shape = shape_of(name)
    with open_arm(name) as arm:
        numbers = ("counts_per_degree", "counts_per_bar", "angle_range", "max_pressure", "links", "period", "latency")
        assert shape == replace(arm.spec, **{number: getattr(shape, number) for number in numbers})


def test_of_other_arms_nothing_is_known_before_they_are_opened():
    assert shape_of("python:tests.plain_arms:linear") is None
    assert shape_of("virtual:spec=arm.toml") is None
    with pytest.raises(UnusableInput, match="a joint has 1 or 2 muscles"):
        shape_of("virtual:muscles=3")


def test_a_virtual_arm_is_opened_at_another_rate(tmp_path):
    usual = open_arm("virtual:seed=7")
    for name in ("virtual:seed=7,rate=200", "virtual:period=0.005,seed=7"):
        arm = open_arm(name)
        assert arm.spec.period == pytest.approx(0.005)
        assert arm.spec.latency == pytest.approx(usual.spec.latency * 0.15)
        assert arm.parameters == usual.parameters
    assert open_arm("virtual:rate=10").spec.latency == usual.spec.latency
    known = tmp_path / "arm.toml"
    save_spec(arm.spec, known)
    assert open_arm(f"virtual:seed=7,spec={known}").arm.spec.period == arm.spec.period
    for wrong in ("rate=0", "rate=fast", "period=-1", "period=0.1,rate=10", "rate=nan"):
        with pytest.raises(UnusableInput, match="expected a period"):
            open_arm(f"virtual:{wrong}")
