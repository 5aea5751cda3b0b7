"""The whole job with its defaults on the ten held-out arms, which nothing is developed on.

Takes about a minute an arm on two cores. Settings of ``pneumarm run`` may be given in PNEUMARM_HELD_OUT, such as
"--method q-learning --seed 1"; PNEUMARM_HELD_OUT_ARMS names other arms, such as "virtual,virtual:seed=5". Where a run
plans (agents for reaching do, or --bound-episodes 40), it is told how far below its plans the same movements stay.
"""

import json
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import _environment as environment
from pneumarm.arm.open import names_in

ARMS = ",".join(f"virtual:seed={seed}" for seed in range(1001, 1011))
HEADER = f"{'arm':28}{'':12}{'reward':>18}{'success':>22}{'actions':>9}{'switches':>9}"


def measure() -> Iterator[str]:
    arms = names_in(environment.text("PNEUMARM_HELD_OUT_ARMS", ARMS))
    yield HEADER
    found = []
    for arm in arms:
        found.append(run(arm))
        yield from rows(arm, found[-1])
    for name, phase in (("simulation", "test"), ("arrival", "before"), ("adapted", "after")):
        each = [figures(results, phase) for results in found]
        means = {key: sum(one[key] for one in each) / len(each) for key in ("reward", "success_rate")}
        lowest = min(one["success_rate"] for one in each)
        yield f"{'mean of all':28}{name:12}{means['reward']:8.2f}{means['success_rate']:21.4f} (lowest {lowest:.4f})"
    seconds = [sum(results["wall_seconds"].values()) for results in found]
    yield f"seconds a run: {min(seconds):.0f} to {max(seconds):.0f}"


def run(arm: str) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "pneumarm.cli", "run", "--arm", arm, "--out", str(Path(folder) / "run")]
        command += ["--json", *shlex.split(environment.text("PNEUMARM_HELD_OUT", ""))]
        done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    results: dict[str, Any] = json.loads(done.stdout)
    return results


def figures(results: dict[str, Any], phase: str) -> dict[str, Any]:
    found: dict[str, Any] = results["test"] if phase == "test" else results["transfer"][phase]
    return found


def rows(arm: str, results: dict[str, Any]) -> Iterator[str]:
    for name, phase in (("simulation", "test"), ("arrival", "before"), ("adapted", "after")):
        one = figures(results, phase)
        low, high = one["intervals"]["reward"]
        worst, best = one["intervals"]["success_rate"]
        reward = f"{one['reward']:.2f} ± {(high - low) / 2:.2f}"
        success = f"{one['success_rate']:.4f} ({worst:.3f}..{best:.3f})"
        yield f"{arm:28}{name:12}{reward:>18}{success:>22}{one['actions']:9.2f}{np.sum(one['switches']):9.2f}"
        arm = ""
    for name, phase in (("arrival", "before"), ("adapted", "after")):
        if planned := results["bound"].get("distance", {}).get(phase):
            best = max(planned.values(), key=lambda one: float(one["planned"]))
            low, high = best["interval"]
            yield (
                f"{'':28}{name:12}{best['reward']:8.2f} ({low:.2f} to {high:.2f}) below {best['planned']:.2f}, "
                f"which is possible, in {best['episodes']} of its movements"
            )
