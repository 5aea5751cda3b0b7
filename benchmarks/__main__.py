"""Run all benchmarks, or those named on the command line."""

import importlib
import pkgutil
import signal
import sys

import benchmarks
from pneumarm.console import complain
from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.leaving import Interrupted, signals_as_exceptions

LONG = (
    "adaptation",
    "agents",
    "bound",
    "chosen",
    "constants",
    "dead_time",
    "double_poles",
    "evolution",
    "faults",
    "few_sensors",
    "guarantee",
    "held_out",
    "holding",
    "hysteresis",
    "live",
    "minutes",
    "moving",
    "moving_pictures",
    "baselines",
    "parts",
    "sensors",
    "serial",
    "sound_arms",
    "success",
    "wide_arms",
)
"""What takes many minutes runs only when it is named."""


def main(names: list[str]) -> int:
    """Run the benchmarks ``names``, or all that are short; return what the process is to end with."""
    found = [module.name for module in pkgutil.iter_modules(benchmarks.__path__) if not module.name.startswith("_")]
    try:
        for name in names or [name for name in found if name not in LONG]:
            if name not in found:
                raise UnusableInput(f"benchmark {name!r}: expected one of {', '.join(found)}")
            print(f"== {name.replace('_', ' ')}", flush=True)
            for line in importlib.import_module(f"benchmarks.{name}").measure():
                print(line, flush=True)
    except PneumarmError as error:
        complain(error)
        return error.exit_code
    except KeyboardInterrupt as error:
        complain("interrupted; a benchmark that keeps what was measured goes on when it is called again")
        return error.exit_code if isinstance(error, Interrupted) else 128 + signal.SIGINT
    return 0


if __name__ == "__main__":
    signals_as_exceptions()
    sys.exit(main(sys.argv[1:]))
