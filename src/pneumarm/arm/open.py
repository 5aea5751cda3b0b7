"""Open an arm by its name on the command line."""

import importlib
import sys
from dataclasses import replace
from pathlib import Path

from pneumarm.arm.seam import Arm, ArmSpec
from pneumarm.errors import UnusableInput

_FORMS = (
    "virtual, virtual:seed=7, virtual:preset=A, simulation:FILE, serial:PORT, emulated:ARM or python:module:callable"
)
_SPEC = ",spec="


def open_arm(name: str, seed: int = 0, spec: Path | None = None) -> Arm:
    """Return the arm called ``name``; ``seed`` seeds the noise of its sensors and of its surroundings.

    ``virtual`` is the nominal virtual arm, ``virtual:seed=N`` another one from the distribution of arms;
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
        from pneumarm.arm.virtual import VirtualArm, draw_parameters, preset_parameters

        if not rest:
            return VirtualArm(seed=seed)
        key, _, value = rest.partition("=")
        if key == "seed" and value.isdecimal():
            return VirtualArm(draw_parameters(int(value)), seed=seed, name=name)
        if key == "preset":
            return VirtualArm(preset_parameters(value), seed=seed, name=name)
    elif kind == "simulation" and rest:
        from pneumarm.simulation import Simulation, SimulationArm

        return SimulationArm(Simulation.load(Path(rest)), seed=seed)
    elif kind == "serial" and rest:
        from pneumarm.arm.serial.arm import SerialArm
        from pneumarm.arm.serial.port import SerialPort

        return SerialArm(SerialPort(rest), spec or ArmSpec(name=name))
    elif kind == "emulated" and rest:
        from pneumarm.arm.serial import BoardLine, EmulatedBoard, SerialArm

        inner = _open(rest, seed)
        return SerialArm(BoardLine(EmulatedBoard(inner)), replace(spec or inner.spec, name=name))
    elif kind == "python" and rest.count(":") == 1:
        return _from_python(rest)
    raise UnusableInput(f"arm {name!r}: expected {_FORMS}")


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
