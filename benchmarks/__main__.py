"""Run all benchmarks, or those named on the command line."""

import importlib
import pkgutil
import sys

import benchmarks

if __name__ == "__main__":
    names = sys.argv[1:] or [m.name for m in pkgutil.iter_modules(benchmarks.__path__) if m.name != "__main__"]
    for name in names:
        print(f"== {name.replace('_', ' ')}", flush=True)
        for line in importlib.import_module(f"benchmarks.{name}").measure():
            print(line, flush=True)
