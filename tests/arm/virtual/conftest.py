"""Arms for trials: without noise, and held still where a trial asks for it."""

from dataclasses import replace

import pytest

from pneumarm.arm.virtual import ArmParameters


def _quiet(parameters: ArmParameters) -> ArmParameters:
    """The same arm with a steady supply, a room at the reference temperature, and perfect sensors."""
    return replace(
        parameters,
        air=replace(parameters.air, fluctuation=0.0, compressor=0.0),
        room=replace(parameters.room, cold=20.0, warm=20.0),
        sensors=replace(parameters.sensors, angle_noise=0.0, pressure_noise=0.0),
        jitter=0.0,
    )


def _held(parameters: ArmParameters) -> ArmParameters:
    """The same arm, so heavy that it does not move (and hangs straight)."""
    joints = tuple(replace(joint, link_inertia=1e9, tilt=0.0) for joint in parameters.joints)
    return replace(_quiet(parameters), joints=joints)


@pytest.fixture(scope="session")
def quiet():
    return _quiet


@pytest.fixture(scope="session")
def held():
    return _held


@pytest.fixture(scope="session")
def nominal():
    return _quiet(ArmParameters())
