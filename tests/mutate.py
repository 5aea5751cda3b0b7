"""Change the program in one place at a time, and see that the tests named for it fail: `make mutants`.

The list is ``mutants.toml`` beside this file. Each mutant replaces a snippet, found exactly once in its file, in a
copy of the project, and its tests, which pass without the change, have to fail with it. What was found is kept in
``.mutants``, with what it was found for: the sources, the tests and the mutant. A second call goes on from there.

With ``--quick`` (`make mutants QUICK=1`) there is one mutant for each folder, and the tests are those of `make test`.

Ends with 0 where every mutant is killed, with 1 where one survives, and with 2 where the list itself is wrong. Where
tests are skipped on this machine, a mutant was not run, which is said and is no failure.
"""

import argparse
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tomllib
import xml.etree.ElementTree
from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from threading import Lock
from time import monotonic, perf_counter
from typing import Literal, NamedTuple

ROOT = Path(__file__).parents[1]
LIST = "tests/mutants.toml"
KEPT = ".mutants"
TOO_LONG = 900
"""Tests of a mutant that run for so long [s] hang; a change that makes them hang is none for this list."""
QUICK = "not soak and not walk and not thorough"
"""Marks of the tests that `make test` runs."""
NOT_COPIED = (".*", "__pycache__", "runs", "site", "build", "node_modules", "*.egg-info", "*.db*")

Outcome = Literal["wrong", "survived", "not run", "killed"]
OUTCOMES: tuple[Outcome, ...] = ("wrong", "survived", "not run", "killed")
"""The worst first."""


class ListError(Exception):
    """The list of mutants is not as it has to be."""


@dataclass(frozen=True)
class Mutant:
    """A change and the tests that fail with it."""

    name: str
    package: str
    """What it is a fault of, for people, and for who runs a few of each."""
    file: str
    """From the root of the project."""
    snippet: str
    replacement: str
    tests: list[str]
    """Ids as pytest has them, without parameters or with them."""
    kernel: bool = False
    """Whether the change is in code that is compiled, so that kernels compiled before are of no use."""

    @property
    def folder(self) -> str:
        """Return the folder that it is in, see :func:`folder_of`."""
        return folder_of(Path(self.file))


class Found(NamedTuple):
    """What came of a mutant, or of tests without one."""

    outcome: Outcome
    words: str
    """Why, where it is not killed."""
    seconds: float


def read_list(root: Path) -> list[Mutant]:
    """Return the mutants of the project in ``root``.

    Raises:
        ListError: a name is there twice, a snippet is not found exactly once, or a test is not there.

    """
    entries = tomllib.loads((root / LIST).read_text(encoding="utf-8"))["mutant"]
    mutants = [Mutant(**entry) for entry in entries]
    wrong = [f"{name}: there are {n} of this name" for name, n in Counter(m.name for m in mutants).items() if n > 1]
    # A test may run in another file than it is written in: the board's tests run on the emulated board too.
    tests = "".join(path.read_text(encoding="utf-8") for path in (root / "tests").rglob("test_*.py"))
    wrong += [f"{mutant.name}: {what}" for mutant in mutants for what in _wrong_with(root, mutant, tests)]
    if wrong:
        raise ListError("\n".join(wrong))
    return mutants


def _wrong_with(root: Path, mutant: Mutant, tests: str) -> Iterable[str]:
    file = root / mutant.file
    count = file.read_text(encoding="utf-8").count(mutant.snippet) if file.is_file() else 0
    if not file.is_file():
        yield f"there is no file {mutant.file}"
    elif count != 1:
        yield f"the snippet is there {count} times in {mutant.file}, not once: {mutant.snippet!r}"
    if mutant.replacement == mutant.snippet:
        yield "the replacement changes nothing"
    if not mutant.tests:
        yield "no tests are named"
    for test in mutant.tests:
        path, _, name = test.partition("::")
        if not (root / path).is_file() or f"def {name.partition('[')[0]}(" not in tests:
            yield f"there is no test {test}"


def folder_of(file: Path) -> str:
    """Return the folder of the package or the firmware that ``file`` lies in, itself or deeper."""
    return "/".join(file.parent.parts[:3])


def folders(root: Path) -> set[str]:
    """Return all folders that code lies in, see :func:`folder_of`."""
    files = [*(root / "src").rglob("*.py"), *(root / "firmware").rglob("*.c")]
    return {folder_of(file.relative_to(root)) for file in files}


def quick_ones(root: Path, mutants: Sequence[Mutant]) -> list[Mutant]:
    """Return one of the ``mutants`` for each folder, with tests that are all run by `make test`.

    Raises:
        ListError: a folder has none, or the tests cannot be collected.

    """
    command = [sys.executable, "-m", "pytest", "--collect-only", "--verbosity=-1", "-p", "no:xdist", "-m", QUICK]
    said = subprocess.run(command, cwd=root, env=_environment(root), capture_output=True, text=True, check=False)
    if said.returncode:
        raise ListError(f"tests cannot be collected: {said.stdout}{said.stderr}")
    run = {line for line in said.stdout.splitlines() if "::" in line}
    run |= {line.partition("[")[0] for line in run}  # all its cases, or some of them
    chosen: dict[str, Mutant] = {}
    for mutant in sorted(mutants, key=lambda one: one.kernel):  # what need not be compiled first
        if run.issuperset(mutant.tests):
            chosen.setdefault(mutant.folder, mutant)
    if missing := folders(root) - chosen.keys():
        raise ListError("\n".join(f"{folder}: make test runs the tests of no mutant" for folder in sorted(missing)))
    return [mutant for mutant in mutants if mutant in chosen.values()]


def _environment(place: Path) -> dict[str, str]:
    """Return the variables with which tests run the project in ``place``."""
    paths = os.pathsep.join(str(one) for one in (place / "src", place / "tests", place))
    return os.environ | {"PYTHONPATH": paths}


class Results:
    """What was found before, in a file; what was found for other sources, tests or mutants does not count."""

    def __init__(self, file: Path, sources: str) -> None:
        self._file, self._sources, self._lock = file, sources, Lock()
        try:
            self._kept = json.loads(file.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            self._kept = {}

    def of(self, name: str, asked: object) -> Found | None:
        """Return what was found for ``name`` where the same was asked of the same sources."""
        kept = self._kept.get(name)
        return Found(*kept["found"]) if kept and kept["for"] == self._key(asked) else None

    def keep(self, name: str, asked: object, found: Found) -> None:
        """Keep what was found, at once: a run that is interrupted goes on after it."""
        with self._lock:
            self._kept[name] = {"for": self._key(asked), "found": found}
            part = self._file.with_suffix(".part")
            part.write_text(json.dumps(self._kept, indent=1), encoding="utf-8")
            part.replace(self._file)

    def seconds(self, name: str) -> float | None:
        """Return how long ``name`` took the last time, whatever it was then."""
        kept = self._kept.get(name)
        return Found(*kept["found"]).seconds if kept else None

    def _key(self, asked: object) -> str:
        return hashlib.sha256(f"{self._sources} {json.dumps(asked)}".encode()).hexdigest()[:16]


def hash_of(root: Path) -> str:
    """Return a hash of all that tests depend on: sources, firmware, tests, settings, but for the list."""
    digest = hashlib.sha256(sys.version.encode())
    paths = [path for folder in ("src", "firmware", "tests") for path in (root / folder).rglob("*")]
    for path in sorted([*paths, root / "pyproject.toml"]):
        parts = path.relative_to(root).parts
        if path.is_file() and path != root / LIST and not {"__pycache__", "build", "node_modules"} & {*parts}:
            digest.update("/".join(parts).encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


class Tree:
    """A copy of the project in which one place can be changed; its path stays, since compiled kernels know it."""

    def __init__(self, root: Path, place: Path, marks: str | None) -> None:
        """Copy the project in ``root`` to ``place``; tests are run if they have the ``marks``."""
        shutil.rmtree(place, ignore_errors=True)
        shutil.copytree(root, place, ignore=shutil.ignore_patterns(*NOT_COPIED))
        self._place = place
        self._marks = [] if marks is None else ["-m", marks]
        self._kernels = place.with_name(f"{place.name}-kernels")
        """Compiled for the sources as they are."""

    def run(self, tests: Sequence[str]) -> "Ran":
        """Run ``tests`` as they are, to their end."""
        return self._run(tests, self._kernels, {}, "--maxfail=1000000")

    def run_with(self, mutant: Mutant) -> "Ran":
        """Run the tests of ``mutant`` with its change, until the first one fails."""
        file = self._place / mutant.file
        before, written = file.read_bytes(), file.stat()
        kernels = self._place.with_name(f"{self._place.name}-changed-kernels")
        shutil.rmtree(kernels, ignore_errors=True)
        try:
            file.write_text(before.decode().replace(mutant.snippet, mutant.replacement), encoding="utf-8")
            if not mutant.kernel:
                self._lend_kernels(kernels)
            # Bytecode of a changed source must not be found later for another change of the same size.
            return self._run(mutant.tests, kernels, {"PYTHONDONTWRITEBYTECODE": "1"}, "-x")
        finally:
            file.write_bytes(before)
            os.utime(file, ns=(written.st_atime_ns, written.st_mtime_ns))
            if mutant.file.startswith("firmware/"):  # which make takes for newer than the sources
                shutil.rmtree(self._place / "firmware" / "build", ignore_errors=True)
            shutil.rmtree(kernels, ignore_errors=True)

    def _lend_kernels(self, folder: Path) -> None:
        """Put the kernels of the unchanged sources where those of the changed ones are looked for."""
        package = self._place / "src" / "pneumarm"
        newest = max(self._kernels.glob("*/"), key=lambda one: one.stat().st_mtime, default=None)
        if newest is not None and package.is_dir():
            from pneumarm.kernels import sources_hash

            shutil.copytree(newest, folder / sources_hash(package), copy_function=os.link)

    def _run(self, tests: Sequence[str], kernels: Path, more: dict[str, str], *options: str) -> "Ran":
        place = self._place
        report = place.with_name(f"{place.name}.xml")
        report.unlink(missing_ok=True)
        quiet = ["-q", "--tb=short", "-p", "no:cacheprovider", "-p", "no:xdist"]
        command = [sys.executable, "-m", "pytest", *tests, *options, *self._marks, *quiet, f"--junitxml={report}"]
        environment = _environment(place) | {"PNEUMARM_CACHE": str(kernels)} | more
        began = perf_counter()
        try:
            done = subprocess.run(
                command,
                cwd=place,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                errors="replace",
                timeout=TOO_LONG,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return Ran(-1, "", [], perf_counter() - began)
        cases = _cases(report) if report.exists() else []
        return Ran(done.returncode, done.stdout, cases, perf_counter() - began)


class Case(NamedTuple):
    """A test that ran."""

    test: str
    outcome: Literal["passed", "failed", "error", "skipped"]
    words: str


class Ran(NamedTuple):
    """What came of running pytest."""

    code: int
    """What it ended with; -1 where it did not."""
    said: str
    cases: list[Case]
    seconds: float

    @property
    def why(self) -> str:
        """The end of what was said, for people."""
        lines = [line for line in self.said.splitlines() if line.strip()]
        return f"not done after {TOO_LONG} s" if self.code == -1 else " | ".join(lines[-3:])

    def without_change(self, tests: Iterable[str]) -> dict[str, Found]:
        """Return for each of the ``tests`` whether it can tell anything: "killed" where it passes."""
        return {test: self._of(test) for test in tests}

    def _of(self, test: str) -> Found:
        path, _, name = test.partition("::")
        wanted = f"{path.removesuffix('.py').replace('/', '.')}::{name}"
        cases = [one for one in self.cases if one.test == wanted or (one.test.startswith(f"{wanted}["))]
        bad = next((one for one in cases if one.outcome in ("failed", "error")), None)
        if not cases or bad:
            return Found("wrong", f"{test} does not pass without the change: {bad.words if bad else self.why}", 0.0)
        if all(one.outcome == "skipped" for one in cases):
            return Found("not run", f"{test} is skipped: {cases[0].words}", 0.0)
        return Found("killed", "", 0.0)

    def with_change(self) -> Found:
        """Return what became of a mutant whose tests these are."""
        outcomes = {case.outcome for case in self.cases}
        if self.code == 1 and "failed" in outcomes:
            return Found("killed", "", self.seconds)
        if self.code == 0 and outcomes == {"skipped"}:
            return Found("not run", self.cases[0].words, self.seconds)
        if self.code == 0:
            return Found("survived", "its tests pass", self.seconds)
        return Found("wrong", f"its tests neither pass nor fail: {self.why}", self.seconds)


def _cases(report: Path) -> list[Case]:
    cases = []
    for case in xml.etree.ElementTree.parse(report).iter("testcase"):
        test = f"{case.get('classname')}::{case.get('name')}"
        bad = {kind: case.find(kind) for kind in ("failure", "error", "skipped")}
        outcome, what = next(((kind, one) for kind, one in bad.items() if one is not None), ("passed", None))
        words = "" if what is None else (what.get("message") or "").partition("\n")[0]
        cases.append(Case(test, "failed" if outcome == "failure" else outcome, words))  # type: ignore[arg-type]
    return cases


class Progress:
    """Says what is done, and for how much longer it goes on: by how long each took the last time it was run."""

    def __init__(self, results: Results, names: Sequence[str], workers: int) -> None:
        self._left = dict.fromkeys(names)
        self._expected = {name: results.seconds(name) for name in names}
        self._all, self._workers, self._taken = len(names), workers, list[float]()
        self._lock = Lock()

    def done(self, name: str, outcome: str, found: Found) -> None:
        """Say what came of ``name``."""
        with self._lock:
            del self._left[name]
            self._taken.append(found.seconds)
            number = f"{self._all - len(self._left):3}/{self._all}"
            words = f": {found.words}" if found.words else ""
            print(f"{number}  {outcome:9} {name}  {found.seconds:.1f} s{self._rest()}{words}", flush=True)

    def _rest(self) -> str:
        if not self._left:
            return ""
        usual = sum(self._taken) / len(self._taken)
        seconds = sum(usual if (known := self._expected[name]) is None else known for name in self._left)
        return f"  ({max(seconds / self._workers / 60, 0.1):.1f} min left)"


class Hunt:
    """Runs mutants, several packages at a time, each worker in a copy of its own."""

    def __init__(self, root: Path, mutants: Sequence[Mutant], workers: int, marks: str | None) -> None:
        self._root, self._workers = root, workers
        self._mutants, self._marks = mutants, marks
        self._kept = root / KEPT
        self._kept.mkdir(exist_ok=True)
        self._results = Results(self._kept / ("quick.json" if marks else "results.json"), hash_of(root))
        self._places = list(range(workers))
        self._lock = Lock()

    def run(self) -> dict[str, Found]:
        """Return what came of each mutant."""
        found = {m.name: known for m in self._mutants if (known := self._results.of(m.name, asdict(m)))}
        found = {name: one for name, one in found.items() if one.outcome == "killed"}
        left = [mutant for mutant in self._mutants if mutant.name not in found]
        if found:
            print(f"{len(found)} of {len(self._mutants)} are killed by what was kept in {KEPT}")
        if not left:
            return found
        groups: dict[str, list[Mutant]] = {}
        for mutant in left:
            groups.setdefault(mutant.package, []).append(mutant)
        names = [*[f"{package}: unchanged" for package in groups], *[mutant.name for mutant in left]]
        progress = Progress(self._results, names, min(self._workers, len(groups)))
        longest_first = sorted(groups.values(), key=len, reverse=True)
        with ThreadPoolExecutor(self._workers) as pool:
            for part in pool.map(lambda group: self._group(group, progress), longest_first):
                found |= part
        return found

    def _group(self, group: Sequence[Mutant], progress: Progress) -> dict[str, Found]:
        with self._lock:
            place = self._places.pop(0)
        try:
            tree = Tree(self._root, self._kept / f"tree-{place}", self._marks)
            name = f"{group[0].package}: unchanged"
            tests = sorted({test for mutant in group for test in mutant.tests})
            ran = tree.run(tests)
            before = ran.without_change(tests)
            bad = [one.words for one in before.values() if one.outcome != "killed"]
            known = Found("wrong" if bad else "killed", "", ran.seconds)
            self._results.keep(name, tests, known)
            progress.done(name, "has flaws" if bad else "passes", known)
            return {mutant.name: self._one(tree, mutant, before, progress) for mutant in group}
        finally:
            with self._lock:
                self._places.append(place)

    def _one(self, tree: Tree, mutant: Mutant, before: dict[str, Found], progress: Progress) -> Found:
        tests = sorted((before[test] for test in mutant.tests), key=lambda one: OUTCOMES.index(one.outcome))
        usable = tests[0].outcome != "wrong" and tests[-1].outcome == "killed"
        found = tree.run_with(mutant).with_change() if usable else tests[0]
        self._results.keep(mutant.name, asdict(mutant), found)
        progress.done(mutant.name, found.outcome, found)
        return found


def main(arguments: Sequence[str] | None = None, root: Path = ROOT) -> int:
    """Run the mutants that are asked for; return 0 where all are killed."""
    parser = argparse.ArgumentParser(description="Change the program in one place at a time: its tests must fail.")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--only", metavar="NAME", action="append", help="a mutant, or a package; again for more")
    which.add_argument("--quick", action="store_true", help="one in each folder, by the tests of make test alone")
    parser.add_argument("--list", action="store_true", help="say which there are, and run nothing")
    parser.add_argument("--workers", type=int, default=min(os.cpu_count() or 1, 2), help="so many at a time")
    options = parser.parse_args(arguments)
    try:
        mutants = read_list(root)
        if options.quick:
            mutants = quick_ones(root, mutants)
    except ListError as error:
        print(f"{LIST} has to be put right:\n{error}", file=sys.stderr)
        return 2
    if options.only:
        unknown = {*options.only} - {name for mutant in mutants for name in (mutant.name, mutant.package)}
        if unknown:
            print(f"no mutant or package {', '.join(sorted(unknown))}; see --list", file=sys.stderr)
            return 2
        mutants = [mutant for mutant in mutants if {mutant.name, mutant.package} & {*options.only}]
    if options.list:
        print("\n".join(f"{mutant.package}: {mutant.name}" for mutant in mutants))
        return 0
    began = monotonic()
    found = Hunt(root, mutants, max(options.workers, 1), QUICK if options.quick else None).run()
    counts = Counter(one.outcome for one in found.values())
    for mutant in mutants:
        one = found[mutant.name]
        if one.outcome == "survived":
            change = f"{mutant.file}, {mutant.snippet!r} -> {mutant.replacement!r}"
            print(f"SURVIVED {mutant.name}: {change}; pass: {', '.join(mutant.tests)}")
        elif one.outcome != "killed":
            print(f"{one.outcome.upper()} {mutant.name}: {one.words}")
    said = ", ".join(f"{counts[outcome]} {outcome}" for outcome in reversed(OUTCOMES))
    print(f"{len(found)} mutants: {said}; {(monotonic() - began) / 60:.1f} min")
    return 2 if counts["wrong"] else 1 if counts["survived"] else 0


if __name__ == "__main__":
    sys.exit(main())
