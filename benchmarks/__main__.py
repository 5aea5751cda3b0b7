"""Run all benchmarks, or those named on the command line."""

import importlib
import pkgutil
import sys

import benchmarks

LONG = (
    "adaptation",
    "agents",
    "bound",
    "faults",
    "few_sensors",
    "held_out",
    "holding",
    "live",
    "minutes",
    "moving",
    "moving_pictures",
    "baselines",
    "sensors",
    "serial",
    "sound_arms",
    "success",
    "wide_arms",
)
"""What takes many minutes runs only when it is named."""

if __name__ == "__main__":
    found = [module.name for module in pkgutil.iter_modules(benchmarks.__path__) if not module.name.startswith("_")]
    names = sys.argv[1:] or [name for name in found if name not in LONG]
    for name in names:
        print(f"== {name.replace('_', ' ')}", flush=True)
        for line in importlib.import_module(f"benchmarks.{name}").measure():
            print(line, flush=True)
