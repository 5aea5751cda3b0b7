import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # for the synthetic arm, which is no package

from synthetic_arm import synthetic_begin_states, synthetic_simulation

from pneumarm.simulation.simulation import Simulation
from pneumarm.task import BeginStates


@pytest.fixture(scope="session")
def simulation() -> Simulation:
    return synthetic_simulation()


@pytest.fixture(scope="session")
def begin(simulation: Simulation) -> BeginStates:
    return synthetic_begin_states(simulation)
