"""The whole job with its defaults on the ten held-out arms, which nothing is developed on.

Takes about a minute an arm on two cores. Settings of ``pneumarm run`` may be given in PNEUMARM_HELD_OUT, such as
"--method q-learning --seed 1"; PNEUMARM_HELD_OUT_ARMS names other arms, such as "virtual,virtual:seed=5". Where a run
plans (agents for reaching do, or --bound-episodes 40), it is told how far below its plans the same movements stay;
where its agent settles (the default does), at how many goals. Of few movements there are no intervals.
"""

import json
import math
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
from pneumarm.errors import PneumarmError, UnusableInput

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
    if each := [results["settle"] for results in found if results["settle"]]:
        settled, rest = (float(np.mean([one[key] for one in each])) for key in ("settled", "rest_error_deg"))
        lowest = min(one["settled"] for one in each)
        median = np.mean([one["median_seconds"] or math.nan for one in each])
        said = f"settles at {settled:.4f} (lowest {lowest:.3f}), half within {median:.2f} s, rests {rest:.2f}° off"
        yield f"{'mean of all':28}{'adapted':12}{said}"
    seconds = [sum(results["wall_seconds"].values()) for results in found]
    yield f"seconds a run: {min(seconds):.0f} to {max(seconds):.0f}"


def run(arm: str) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "pneumarm.cli", "run", "--arm", arm, "--out", str(Path(folder) / "run")]
        command += ["--json", *shlex.split(environment.text("PNEUMARM_HELD_OUT", ""))]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True)
    if done.returncode:
        kind = UnusableInput if done.returncode == UnusableInput.exit_code else PneumarmError
        raise kind(f"the run on {arm} ended with {done.returncode}; what it says of that is above")
    results: dict[str, Any] = json.loads(done.stdout)
    return results


def figures(results: dict[str, Any], phase: str) -> dict[str, Any]:
    found: dict[str, Any] = results["test"] if phase == "test" else results["transfer"][phase]
    return found


def rows(arm: str, results: dict[str, Any]) -> Iterator[str]:
    for name, phase in (("simulation", "test"), ("arrival", "before"), ("adapted", "after")):
        one = figures(results, phase)
        reward, success = f"{one['reward']:.2f}", f"{one['success_rate']:.4f}"
        if interval := one["intervals"]["reward"]:  # none of few movements
            reward += f" ± {(interval[1] - interval[0]) / 2:.2f}"
        if interval := one["intervals"]["success_rate"]:
            success += f" ({interval[0]:.3f}..{interval[1]:.3f})"
        yield f"{arm:28}{name:12}{reward:>18}{success:>22}{one['actions']:9.2f}{np.sum(one['switches']):9.2f}"
        arm = ""
    if settled := results["settle"]:
        yield (
            f"{'':28}{'adapted':12}settles at {settled['settled']:.3f} of {settled['movements']} goals, half within "
            f"{settled['median_seconds'] or math.nan:.2f} s, rests {settled['rest_error_deg']:.2f}° off"
        )
    for name, phase in (("arrival", "before"), ("adapted", "after")):
        if planned := results["bound"].get("distance", {}).get(phase):
            best = max(planned.values(), key=lambda one: float(one["planned"]))
            low, high = best["interval"]
            yield (
                f"{'':28}{name:12}{best['reward']:8.2f} ({low:.2f} to {high:.2f}) below {best['planned']:.2f}, "
                f"which is possible, in {best['episodes']} of its movements"
            )
