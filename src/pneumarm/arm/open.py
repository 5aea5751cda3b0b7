"""Open an arm by its name on the command line."""

import importlib
import sys
from dataclasses import replace
from pathlib import Path

from pneumarm.arm.seam import Arm, ArmSpec
from pneumarm.errors import UnusableInput

_FORMS = (
    "virtual, virtual:seed=7, virtual:preset=A, virtual:seed=7,sensors=velocity+temperature, "
    "virtual:seed=7,faults=PLAN.toml, simulation:FILE, serial:PORT, emulated:ARM or python:module:callable"
)
_FAULTS = ",faults="
_SENSORS = ",sensors="
_SPEC = ",spec="


def open_arm(name: str, seed: int = 0, spec: Path | None = None) -> Arm:
    """Return the arm called ``name``; ``seed`` seeds the noise of its sensors and of its surroundings.

    ``virtual`` is the nominal virtual arm, ``virtual:seed=N`` another one from the distribution of arms,
    ``virtual:seed=N,sensors=velocity+acceleration+temperature`` one with further sensors, any of these
    (:mod:`pneumarm.arm.virtual.further`), ``virtual:seed=N,faults=PLAN.toml`` one with faults
    (:mod:`pneumarm.arm.virtual.faults`);
    ``simulation:FILE`` a fitted simulation; ``serial:PORT`` an arm behind a microcontroller on a serial port;
    ``emulated:ARM`` an arm behind an emulated microcontroller, as fast as it can be computed;
    ``python:module:callable`` calls ``callable()`` for the arm.
    ``spec`` is a file from ``pneumarm arm calibrate``, which any name may also end in: ``NAME,spec=arm.toml``.
    The arm is not guarded: see :func:`pneumarm.arm.guarded`.

    Raises:
        UnusableInput: no arm has this name, or the file is not one of this arm.

    """
    name, found, file = name.partition(_SPEC)
    if found or spec is not None:
        from pneumarm.arm.corrected import CorrectedArm
        from pneumarm.arm.spec_file import load_arm_file

        known = load_arm_file(spec or file)
        arm = _open(name, seed, known.spec)
        try:
            return CorrectedArm(arm, known)
        except UnusableInput:
            arm.close()
            raise
    return _open(name, seed)


def _open(name: str, seed: int, spec: ArmSpec | None = None) -> Arm:
    kind, _, rest = name.partition(":")
    if kind == "virtual":
        return _virtual(name, rest, seed, spec)
    if kind == "emulated" and rest:
        from pneumarm.arm.serial import BoardLine, EmulatedBoard, SerialArm

        inner = _open(rest, seed, spec)
        return SerialArm(BoardLine(EmulatedBoard(inner)), replace(spec or inner.spec, name=name))
    if _FAULTS in rest:
        raise UnusableInput(f"arm {name!r}: only a virtual arm plays faults; remove {_FAULTS!r} and what follows")
    if kind == "simulation" and rest:
        from pneumarm.simulation import Simulation, SimulationArm

        return SimulationArm(Simulation.load(Path(rest)), seed=seed)
    if kind == "serial" and rest:
        from pneumarm.arm.serial.arm import SerialArm
        from pneumarm.arm.serial.port import SerialPort

        return SerialArm(SerialPort(rest), spec or ArmSpec(name=name))
    if kind == "python" and rest.count(":") == 1:
        return _from_python(rest)
    raise UnusableInput(f"arm {name!r}: expected {_FORMS}")


def _virtual(name: str, rest: str, seed: int, spec: ArmSpec | None) -> Arm:
    """Return the virtual arm with the options ``rest``: seed=N or preset=P, then sensors=KINDS, then faults=FILE.

    Without ``sensors`` it has the further sensors that its ``spec`` names, if it has one.
    """
    from pneumarm.arm.virtual import VirtualArm, draw_parameters, preset_parameters, read_plan, usual_sensors

    options, separator, file = (f",{rest}" if rest.startswith(("faults=", "sensors=")) else rest).partition(_FAULTS)
    first, _, kinds = options.partition(_SENSORS)
    key, _, value = first.partition("=")
    if not first and name != "virtual:":
        parameters = None
    elif key == "seed" and value.isdecimal():
        parameters = draw_parameters(int(value))
    elif key == "preset":
        parameters = preset_parameters(value)
    else:
        raise UnusableInput(f"arm {name!r}: expected {_FORMS}")
    if kinds:
        velocity, sensors = usual_sensors(kinds.split("+"), 1 if parameters is None else len(parameters.joints))
    else:
        velocity, sensors = (spec.velocity_sensor, spec.sensors) if spec is not None else (False, ())
    faults = read_plan(file) if separator else ()
    return VirtualArm(parameters, seed=seed, name=name, faults=faults, velocity_sensor=velocity, sensors=sensors)


def _from_python(place: str) -> Arm:
    module_name, _, attribute = place.partition(":")
    if "" not in sys.path:
        sys.path.insert(0, "")  # a user's module lies in the folder that they call us from
    try:
        arm = getattr(importlib.import_module(module_name), attribute)()
    except (ImportError, AttributeError, ValueError) as error:
        raise UnusableInput(
            f"arm python:{place}: expected a module and a callable in it that returns an Arm; {error}"
        ) from error
    if not isinstance(arm, Arm):
        raise UnusableInput(
            f"arm python:{place}: the callable must return a pneumarm.arm.Arm, it returned {type(arm).__name__}"
        )
    return arm
