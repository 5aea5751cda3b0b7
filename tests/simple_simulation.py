"""A simulation to be followed by hand: pressures change by 10 counts a period, the angle by their difference."""

import numpy as np

from pneumarm.arm import ArmSpec
from pneumarm.networks.network import Network
from pneumarm.simulation import NoiseSettings, Scaling, Simulation
from pneumarm.simulation.simulation import Commands
from pneumarm.transitions import Window

PERIOD = 0.04
QUIET = NoiseSettings(kind="none")


def simulation(joints: int = 1, latency: float = 0.0, commands: Commands = "valves") -> Simulation:
    """Return an arm whose pressures change by 10 counts a period and whose angle follows their difference."""
    window = Window(joints)
    direct = np.zeros((window.input_size, 3 * joints))
    for joint in range(joints):
        command = window.state_size + 2 * joint
        direct[4 * joint, 3 * joint] = -0.2
        direct[[4 * joint + 2, 4 * joint + 3], 3 * joint] = 0.1, -0.1
        direct[command, 3 * joint + 1] = direct[command + 1, 3 * joint + 2] = 0.1
    none = np.zeros((window.input_size, 0)), np.zeros(0), np.zeros((0, 3 * joints)), np.zeros(3 * joints)
    return Simulation(
        ArmSpec(joints=joints, period=PERIOD, latency=latency, name="made up"),
        window,
        Scaling(np.tile([500.0, 0, 100, 100], joints), np.tile([400.0, 5, 100, 100], joints), np.ones(2 * joints)),
        (Network(*none, direct),),
        "derived",
        np.tile([5.0, 0.1, 2, 2], (joints, 1)),
        np.tile([400.0, 600.0], (joints, 1)),
        np.tile([0.0, 200.0], (joints, 2, 1)),
        commands,
    )
