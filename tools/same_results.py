"""Compare what two versions compute: ``python tools/same_results.py REVISION`` (``make same BASE=REVISION``).

Runs the same commands with the sources of a git revision and with those here, and compares files and figures byte for
byte. Times are left out. Says ``same`` or ``differs`` for each, and exits with 1 if anything differs.
"""

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).parent.parent
ARMS = {"one": "virtual:seed=3", "two": "virtual:joints=2,seed=3"}
TIMES = ("seconds", "steps_per_second", "time [s]", "memory", "compil", "decision", "missed_deadlines", "started")
"""Parts of the names of figures that differ from run to run, whatever is computed."""
LEARNERS = {
    "settle": ["--servo.updates", "20", "--servo.agents", "1"],
    "reach": ["--task", "reach", "--policy.updates", "5", "--policy.agents", "1"],
    "sarsa": ["--method", "sarsa", "--thesis.max-episodes", "300", "--agents", "1"],
    "q-learning": ["--method", "q-learning", "--thesis.max-episodes", "300", "--agents", "1"],
    "batched": ["--method", "batched", "--batched.updates", "10", "--batched.agents", "1"],
}


def commands(arm: str, joints: int) -> Iterator[tuple[str, list[str], list[str]]]:
    """Give the name, the command and the files it writes, in an order in which each finds what it needs."""
    yield "collect", ["collect", arm, "arm.db", "--transitions", "3000"], []
    yield "export", ["export", "arm.db", "--out", "arm.csv"], ["arm.csv"]
    yield "coverage", ["coverage", "arm.db"], []
    yield "fit", ["fit", "arm.db", "--out", "arm.sim"], ["arm.sim"]
    for name, options in LEARNERS.items():
        if joints == 2 and name in ("sarsa", "q-learning", "batched"):
            continue
        agent = f"{name}.agent"
        yield f"train {name}", ["train", "arm.sim", "arm.db", "--out", agent, *options], [agent]
        yield f"test {name}", ["test", agent, "arm.sim", "arm.db", "--episodes", "200"], []
        yield (
            f"move {name}",
            ["move", agent, "--arm", arm, ",".join(["20deg"] * joints), ",".join(["-5deg"] * joints)],
            [],
        )
    yield (
        "transfer",
        ["transfer", "reach.agent", "--arm", arm, "--episodes", "5", "--test-episodes", "5", "--out", "adapted"],
        ["adapted/episodes.csv"],
    )
    yield "track", ["track", "settle.agent", "--arm", arm, "--reference", "sine:0.5Hz,10deg", "--seconds", "4"], []
    if joints == 1:
        yield "tune", ["tune", "pid", "--arm", arm, "--out", "arm.pid", "--seconds", "60"], ["arm.pid"]
        yield "move tuned", ["move", "arm.pid", "--arm", arm, "20deg"], []
        yield "plan", ["move", "plan:arm.sim", "--arm", arm, "10deg"], []


def timeless(value: object) -> object:
    """Return ``value``, made of what JSON holds, without figures of time."""
    if isinstance(value, dict):
        return {key: timeless(one) for key, one in value.items() if not any(word in key for word in TIMES)}
    return [timeless(one) for one in value] if isinstance(value, list) else value


def results(source: Path, folder: Path, only: str) -> Iterator[tuple[str, str]]:
    """Run all commands with the sources in ``source`` and give names and what came of each."""
    inside = os.environ | {
        "PYTHONPATH": str(source / "src"),
        "PNEUMARM_CACHE": str(folder / "cache"),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    for joints, (name, arm) in enumerate(ARMS.items(), start=1):
        place = folder / name
        place.mkdir(parents=True)
        for title, command, files in commands(arm, joints):
            if only not in f"{name} {title}":
                continue
            done = subprocess.run(
                [sys.executable, "-m", "pneumarm", *command, "--json"],
                cwd=place,
                env=inside,
                capture_output=True,
                text=True,
                check=False,
            )
            said = done.stdout.strip().splitlines()[-1:]
            found = json.dumps(timeless(json.loads(said[0]))) if said else done.stderr.strip()[-200:]
            yield f"{name} {title}", f"{done.returncode} {found}"
            for file in files:
                content = (place / file).read_bytes() if (place / file).exists() else b"missing"
                yield f"{name} {title}: {file}", hashlib.sha256(content).hexdigest()


@contextmanager
def sources(revision: str) -> Iterator[Path]:
    """Give a folder with the sources of ``revision``."""
    with tempfile.TemporaryDirectory() as temporary:
        tree = Path(temporary) / "tree"
        subprocess.run(["git", "-C", ROOT, "worktree", "add", "--quiet", "--detach", tree, revision], check=True)
        try:
            yield tree
        finally:
            subprocess.run(["git", "-C", ROOT, "worktree", "remove", "--force", tree], check=True)


def main() -> int:
    """Compare, and return what the process is to end with."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("revision")
    parser.add_argument("--only", default="", help="a part of the names of what is run, with all that it needs")
    given = parser.parse_args()
    known = ["git", "-C", ROOT, "rev-parse", "--quiet", "--verify", f"{given.revision}^{{commit}}"]
    if subprocess.run(known, stdout=subprocess.DEVNULL, check=False).returncode:
        parser.error(f"revision {given.revision!r}: expected one that git knows, such as main or HEAD~3")
    different = 0
    with sources(given.revision) as before, tempfile.TemporaryDirectory() as temporary:
        pairs = zip(
            results(before, Path(temporary) / "before", given.only),
            results(ROOT, Path(temporary) / "after", given.only),
            strict=True,
        )
        for (name, old), (_, new) in pairs:
            different += old != new
            print(f"{'same' if old == new else 'differs':<8} {name}", flush=True)
            if old != new and len(old) != 64:
                print(f"    before {old}\n    after  {new}")
    print(f"{different} differ")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
