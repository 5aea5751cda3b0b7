"""How many observations a state holds is judged by a recording of the arm."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.plain_arms import noisy

from pneumarm.arm import Arm
from pneumarm.arm.virtual import VirtualArm
from pneumarm.simulation import FitSettings, fit_store, fitted_on
from pneumarm.simulation.history import USUAL, chosen_history
from pneumarm.transitions import Store, collect

TRANSITIONS = 10_000


def recorded(arm: Arm, path: Path) -> Path:
    with arm, Store.for_arm(path, arm.spec) as store:
        collect(arm, store, TRANSITIONS, 1)
    return path


@pytest.fixture(scope="module")
def of_noisy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(noisy(), tmp_path_factory.mktemp("noisy") / "arm.db")


def test_the_usual_arm_needs_no_more_than_usual(tmp_path: Path) -> None:
    with Store.open(recorded(VirtualArm(seed=3), tmp_path / "arm.db")) as store:
        assert chosen_history(store, store.spec) == USUAL


def test_an_arm_with_noisy_sensors_needs_more_and_is_predicted_better_with_them(of_noisy: Path) -> None:
    with Store.open(of_noisy) as store:
        by_itself, usual = (
            fit_store(store, FitSettings(history=history, memory=1, hysteresis=())) for history in (None, USUAL)
        )
        chosen = by_itself.simulation.window.history
        assert chosen == chosen_history(store, store.spec) > USUAL
        assert by_itself.result.held_out.std[0] < usual.result.held_out.std[0]


@pytest.mark.parametrize(("late", "least"), [(0.05, 4), (0.1, 5)])
def test_valves_that_answer_late_need_what_was_commanded_since(tmp_path: Path, late: float, least: int) -> None:
    sound = VirtualArm(seed=3)
    slow = replace(sound.parameters, air=replace(sound.parameters.air, pipe_delay=late))
    with Store.open(recorded(VirtualArm(slow, seed=3), tmp_path / "arm.db")) as store:
        assert least <= chosen_history(store, store.spec) <= least + 3


def test_it_is_what_was_asked_for_where_something_was(of_noisy: Path) -> None:
    with Store.open(of_noisy) as store:
        assert FitSettings(history=4).of_arm(store).history == 4
        assert FitSettings().of_arm(store).history == chosen_history(store, store.spec)


def test_a_policy_that_settles_sees_more_than_the_networks_read(of_noisy: Path) -> None:
    with Store.open(of_noisy) as store:
        asked = FitSettings(history=3, epochs=4, ahead=0.2)
        seen, read = (fit_store(store, replace(asked, memory=memory)).simulation for memory in (None, 1))
        single = fit_store(store, replace(asked.of_single_steps(), ahead=0.0)).simulation
        on = fitted_on(seen, store)
    names = np.array(seen.window.input_names())
    assert (seen.window.history, read.window.history, single.window.history) == (8, 3, 3)
    for one in seen, on:
        assert sorted(names[one.reads]) == sorted(read.window.input_names())
    np.testing.assert_allclose(seen.error_std, read.error_std, rtol=0.2)
    assert (on.error_std[:, 0] < 1.05 * seen.error_std[:, 0]).all()
