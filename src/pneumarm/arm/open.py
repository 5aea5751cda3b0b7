"""Open an arm by its name on the command line."""

import importlib
import math
import re
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneumarm.arm.own import last_line, owned
from pneumarm.arm.seam import Arm, ArmSpec
from pneumarm.arm.slower import SlowerArm, usual_turns
from pneumarm.errors import ArmFailure, PneumarmError, UnusableInput

if TYPE_CHECKING:
    from pneumarm.arm.virtual import ArmParameters

_FORMS = (
    "virtual, virtual:seed=7, virtual:wide,seed=7, virtual:preset=A, virtual:seed=7,rate=200, "
    "virtual:joints=2,seed=7,coupling=0.5, virtual:seed=7,sensors=velocity+temperature, "
    "virtual:seed=7,pressure_sensors=off, virtual:seed=7,pulses=off, virtual:seed=7,muscles=1, "
    "virtual:seed=7,faults=PLAN.toml, simulation:FILE, serial:PORT, serial:PORT,losses=5, "
    "emulated:ARM or python:module:callable (python:module:callable,every=2), each with ,spec=arm.toml if you like"
)
_OPTIONS = (
    r"(?:seed|preset|joints|coupling|period|rate|sensors|pressure_sensors|pulses|muscles|faults|every|losses|spec)=|"
    r"wide(?:,|$)"
)
_LONGEST_NUMBER = 40  # digits, of a seed as well
_OPTION = re.compile(rf"[:,](?={_OPTIONS})")
"""Stands before an option; files may have commas in their names."""


def open_arm(name: str, seed: int = 0, spec: Path | None = None) -> Arm:
    """Return the arm called ``name``; ``seed`` seeds the noise of its sensors and of its surroundings.

    ``virtual`` is the nominal virtual arm, ``virtual:seed=N`` another one from the distribution of arms,
    ``virtual:wide,seed=N`` one from a wide distribution (:mod:`pneumarm.arm.virtual.wide`), ``virtual:preset=A``, B
    or C one of three readings of the thesis (:func:`pneumarm.arm.virtual.preset_parameters`),
    ``virtual:seed=N,sensors=velocity+acceleration+temperature`` one with further sensors, any of these
    (:mod:`pneumarm.arm.virtual.further`), ``virtual:seed=N,pressure_sensors=off`` one that reads angles alone, its
    supply turned down to what its muscles bear, ``virtual:seed=N,pulses=off`` one whose valves stay as they are for
    whole control periods, ``virtual:seed=N,muscles=1`` one with a spring in place of muscle 2
    (:mod:`pneumarm.arm.virtual.spring`), ``virtual:seed=N,faults=PLAN.toml`` one with faults
    (:mod:`pneumarm.arm.virtual.faults`), ``virtual:seed=N,rate=200`` or ``period=0.005`` one that is controlled at
    200 Hz, not at the rate that it is made for, ``virtual:joints=2,seed=N`` a chain of several joints, up to 4, and
    with ``coupling=0.5`` one whose joints act on each other half as much;
    ``simulation:FILE`` a fitted simulation; ``serial:PORT`` an arm behind a microcontroller on a serial port, with
    ``losses=5`` one whose line may be lost so often within a minute (:meth:`~pneumarm.arm.serial.SerialArm.regain`);
    ``emulated:ARM`` an arm behind an emulated microcontroller, as fast as it can be computed;
    ``python:module:callable`` calls ``callable()`` for the arm; with ``every=2`` it is controlled at every second of
    its periods, by default at those that make some 30 Hz of a rate over 50 Hz (:mod:`pneumarm.arm.slower`), as
    virtual arms are that are made for such a rate.
    ``spec`` is a file from ``pneumarm arm calibrate``, an option of any name: ``NAME,spec=arm.toml``.
    Options come in any order.
    The arm is not guarded: see :func:`pneumarm.arm.guarded`.

    Raises:
        UnusableInput: no arm has this name, or the file is not one of this arm.
        ArmFailure: it cannot be opened.

    """
    place, options = _parts(name)
    file = options.pop("spec", None)
    if spec is None and file is None:
        return _open(place, options, seed)
    from pneumarm.arm.corrected import CorrectedArm
    from pneumarm.arm.spec_file import load_arm_file

    known = load_arm_file(spec if spec is not None else str(file))
    arm = _open(place, options, seed, known.spec)
    try:
        return CorrectedArm(arm, known)
    except UnusableInput:
        arm.close()
        raise


def _parts(name: str) -> tuple[str, dict[str, str]]:
    """Return the ``name`` of an arm without its options, and these, in the order in which they are given."""
    place, *given = _OPTION.split(name)
    options = {key: value for key, _, value in (option.partition("=") for option in given)}
    if len(options) < len(given):
        raise UnusableInput(f"arm {name!r}: an option is given twice; expected {_FORMS}")
    return place, options


def names_in(text: str) -> list[str]:
    """Return the names of arms in ``text``, separated by commas as their options are."""
    return re.split(rf",(?!{_OPTIONS})", text)


def with_options(name: str, **changed: str | None) -> str:
    """Return the ``name`` of a virtual arm with other options, those that are None left out.

    Raises:
        UnusableInput: it is not a virtual arm's.

    """
    place, options = _parts(name)
    if place != "virtual":
        raise UnusableInput(
            f"arm {name!r}: expected a virtual one, only that can have {' or '.join(changed)} changed"
        )
    kept = {key: value for key, value in {**options, **changed}.items() if value is not None}
    return ":".join([place, *([",".join(map(_option, kept.items()))] if kept else [])])


def _open(place: str, options: Mapping[str, str], seed: int, spec: ArmSpec | None = None) -> Arm:
    name = ":".join([place, *([",".join(map(_option, options.items()))] if options else [])])
    kind, _, rest = place.partition(":")
    if "losses" in options and kind not in ("serial", "emulated"):
        raise UnusableInput(f"arm {name!r}: losses= is for arms on a serial port, whose line may be lost")
    if kind in ("serial", "emulated"):
        losses, options = _losses(name, options), {key: options[key] for key in options if key != "losses"}
    if kind != "python" and "every" in options:
        raise UnusableInput(
            f"arm {name!r}: every= is for arms of python:; a virtual arm has rate=, a board its arm.toml"
        )
    if place == "virtual":
        return _virtual(name, options, seed, spec)
    if kind == "emulated" and rest and not rest.startswith(kind):  # a board has an arm behind it, not another board
        from pneumarm.arm.serial import BoardLine, EmulatedBoard, SerialArm

        inner = _open(rest, options, seed, spec)
        return SerialArm(BoardLine(EmulatedBoard(inner)), replace(spec or inner.spec, name=name), losses=losses)
    if kind == "python" and rest.count(":") == 1 and not options.keys() - {"every"}:
        return _from_python(rest, options.get("every"))
    if options:
        raise UnusableInput(f"arm {name!r}: only a virtual arm has {', '.join(options)}; leave that out")
    if kind == "simulation" and rest:
        from pneumarm.simulation import Simulation, SimulationArm

        return SimulationArm(Simulation.load(Path(rest)), seed=seed)
    if kind == "serial" and rest:
        from pneumarm.arm.serial.arm import SerialArm
        from pneumarm.arm.serial.port import SerialPort

        return SerialArm(SerialPort(rest), spec or ArmSpec(name=name), losses=losses)
    raise UnusableInput(f"arm {name!r}: expected {_FORMS}")


def _option(given: tuple[str, str]) -> str:
    return "=".join(given) if given[1] else given[0]


def shape_of(name: str) -> ArmSpec | None:
    """Return the spec of a virtual arm of the same make as the one called ``name``; None of another kind of arm.

    This is known at once; what draws the arm itself is compiled first, which takes seconds.

    Raises:
        UnusableInput: no arm has this name.

    """
    place, options = _parts(name)
    if place != "virtual" or "spec" in options:
        return None
    from pneumarm.arm.virtual.arm import spec_of

    parameters = _parameters(name, {key: options[key] for key in options.keys() & {"joints", "coupling"}})
    return spec_of(parameters, **_make(name, options, None, parameters))


def _virtual(name: str, options: Mapping[str, str], seed: int, spec: ArmSpec | None) -> Arm:
    """Return the virtual arm with ``options``: which one, a rate, kinds of sensors, a file of faults.

    Without them it has the rate and the further sensors of its ``spec``, if it has one.
    """
    from pneumarm.arm.virtual import VirtualArm, read_plan

    parameters = _parameters(name, options)
    faults = read_plan(options["faults"]) if "faults" in options else ()
    return VirtualArm(parameters, seed=seed, faults=faults, **_make(name, options, spec, parameters))


def _make(name: str, options: Mapping[str, str], spec: ArmSpec | None, parameters: "ArmParameters") -> dict[str, Any]:
    """Return what the ``options`` of a virtual arm, or its ``spec``, say beside its ``parameters``."""
    from pneumarm.arm.virtual import usual_sensors

    if "sensors" in options:
        velocity, sensors = usual_sensors(options["sensors"].split("+"), len(parameters.joints))
    else:
        velocity, sensors = (spec.velocity_sensor, spec.sensors) if spec is not None else (False, ())
    usual = usual_turns(parameters.period) * parameters.period
    return {
        "name": name,
        "period": _period(name, options, usual if spec is None else spec.period),
        "velocity_sensor": velocity,
        "sensors": sensors,
        "pressure_sensors": _on(name, options, "pressure_sensors", spec is None or spec.pressure_sensors),
        "pulses": _on(name, options, "pulses", spec is None or spec.pulses),
        "muscles": _muscles(name, options, 2 if spec is None else spec.muscles),
    }


def _muscles(name: str, options: Mapping[str, str], usual: int) -> int:
    """Return how many muscles ``options`` ask for a joint, ``usual`` where they do not say."""
    given = options.get("muscles", str(usual))
    if given not in ("1", "2"):
        raise UnusableInput(f"arm {name!r}: a joint has 1 or 2 muscles, not {given!r}")
    return int(given)


def _parameters(name: str, options: Mapping[str, str]) -> "ArmParameters":
    """Return what the virtual arm with ``options`` is made of: of a preset, drawn, or nominal."""
    from pneumarm.arm.virtual import draw_parameters, draw_wide, nominal_parameters, preset_parameters

    drawn, preset, joints = options.get("seed"), options.get("preset"), options.get("joints", "1")
    wide = "wide" in options
    if not all(map(_is_whole, (drawn or "0", joints))) or (wide and drawn is None):
        raise UnusableInput(f"arm {name!r}: expected {_FORMS}")
    if (preset is not None and {"seed", "joints", "wide"} & options.keys()) or (wide and "joints" in options):
        raise UnusableInput(f"arm {name!r}: these options do not go together; expected {_FORMS}")
    if preset is not None:
        parameters = preset_parameters(preset)
    elif wide:
        parameters = draw_wide(int(str(drawn)))
    elif drawn is not None:
        parameters = draw_parameters(int(drawn), int(joints))
    else:
        parameters = nominal_parameters(int(joints))
    if "coupling" not in options:
        return parameters
    if len(parameters.joints) == 1:
        raise UnusableInput(f"arm {name!r}: one joint is coupled to none; give joints= of 2 or more, or no coupling=")
    try:
        return replace(parameters, coupling=float(options["coupling"]))
    except ValueError as error:
        raise UnusableInput(f"arm {name!r}: expected a coupling of 0 to 1") from error


def _losses(name: str, options: Mapping[str, str]) -> int:
    """Return how many losses of the line within a minute ``options`` allow."""
    from pneumarm.arm.serial.arm import LOSSES

    given = options.get("losses", str(LOSSES))
    if not _is_whole(given):
        raise UnusableInput(f"arm {name!r}: losses is a number from 0 up, of losses a minute, not {given!r}")
    return int(given)


def _is_whole(text: str) -> bool:
    return text.isdecimal() and len(text) <= _LONGEST_NUMBER


def _period(name: str, options: Mapping[str, str], usual: float) -> float:
    """Return the control period [s] that ``options`` ask for, ``usual`` where they ask for none."""
    given = [key for key in ("period", "rate") if key in options]
    if not given:
        return usual
    try:
        value = float(options[given[0]])
    except ValueError:
        value = 0.0
    if len(given) > 1 or not 0 < value < math.inf:
        raise UnusableInput(f"arm {name!r}: expected a period [s] or a rate [Hz] above 0, not both")
    return value if given == ["period"] else 1 / value


def _on(name: str, options: Mapping[str, str], option: str, usual: bool) -> bool:
    """Return whether ``option`` is on, as it ``usual``ly is where it is not given."""
    given = options.get(option, "on" if usual else "off")
    if given not in ("on", "off"):
        raise UnusableInput(f"arm {name!r}: {option} is on or off, not {given!r}")
    return given == "on"


def _from_python(place: str, every: str | None) -> Arm:
    """Return the arm of a user's own, controlled at ``every`` so many of its periods, the usual ones if not given."""
    if every is not None and not _is_whole(every):
        raise UnusableInput(f"arm python:{place}: expected every=1 or more of its periods, not {every!r}")
    arm = owned(_made_by(place))
    turns = int(every) if every is not None else usual_turns(arm.spec.period)
    try:
        return arm if turns == 1 else SlowerArm(arm, turns)
    except UnusableInput:
        arm.close()
        raise


def _made_by(place: str) -> Arm:
    """Return what the callable of ``module:callable`` returns."""
    module_name, _, attribute = place.partition(":")
    if "" not in sys.path:
        sys.path.insert(0, "")  # a user's module lies in the folder that they call us from
    try:
        made_by = getattr(importlib.import_module(module_name), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise UnusableInput(
            f"arm python:{place}: expected a module and a callable in it that returns an Arm; {error}"
        ) from error
    except (Exception, SystemExit) as error:  # whatever stands in it
        told = _told(error, module_name)
        raise UnusableInput(f"arm python:{place}: {module_name} cannot be imported ({told})") from error
    try:
        arm = made_by()
    except PneumarmError:
        raise
    except (Exception, SystemExit) as error:  # whatever its maker's code or its hardware raises
        raise ArmFailure(f"arm python:{place}: cannot be opened ({_told(error, module_name)})") from error
    if not isinstance(arm, Arm):
        raise UnusableInput(
            f"arm python:{place}: the callable must return a pneumarm.arm.Arm, it returned {type(arm).__name__}"
        )
    return arm


def _told(error: BaseException, module: str) -> str:
    return "; ".join(filter(None, [f"{type(error).__name__}: {error}", last_line(error, module)]))
