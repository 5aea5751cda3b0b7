"""The thesis' conclusions and what holds here, from the results of a laboratory's experiments.

    pneumarm claims --out laboratory

``conclusions.toml`` says what the thesis concludes and which experiments test it; what an experiment finds is in its
``results.json``. Nothing is run: an experiment without results is listed with the command that makes them.

A claim holds, or does not, where its 95 % interval over arms lies on one side of what was claimed; else it is open. A
conclusion *holds* where all its claims do, *does not hold* where none does and one is refuted, holds *in part* where
some do and some are refuted, and is *open* otherwise.
"""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, Literal

import msgspec

from pneumarm.errors import UnusableInput
from pneumarm.experiments.registry import PLACES, experiment
from pneumarm.experiments.results import RESULTS
from pneumarm.files import read_bytes
from pneumarm.report.page import Section, Table

FEWEST_ARMS, FEWEST_RUNS = 5, 16
"""Arms, and runs on all of them together, that a claim should rest on."""
Verdict = Literal["holds", "in part", "does not hold", "open", "not run"]


class Conclusion(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Something that the thesis concludes."""

    key: str
    section: str
    """Section of the thesis."""
    says: str
    """What it concludes, in words."""
    experiments: tuple[str, ...]
    """Experiments that test it."""


class _ConclusionsFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    conclusions: tuple[Conclusion, ...]


class FoundClaim(msgspec.Struct, frozen=True):
    """A claim in ``results.json``."""

    claim: str
    thesis: str
    ours: str
    verdict: Literal["holds", "does not hold", "open"]
    about: str


class Results(msgspec.Struct, frozen=True):
    """The part of ``results.json`` that claims rest on."""

    experiment: str
    arms: tuple[str, ...]
    runs: int
    """On each arm."""
    claims: tuple[FoundClaim, ...]

    @property
    def sample(self) -> str:
        """Arms and runs in words."""
        arms, runs = len(self.arms), self.runs
        return f"{arms} arm{'s' * (arms != 1)}, {arms * runs} run{'s' * (arms * runs != 1)}" + (
            "" if self.enough else " (few)"
        )

    @property
    def enough(self) -> bool:
        """Whether there are as many arms and runs as a claim should rest on."""
        return len(self.arms) >= FEWEST_ARMS and len(self.arms) * self.runs >= FEWEST_RUNS


@dataclass(frozen=True)
class Judged:
    """A conclusion with the claims that were found on it."""

    conclusion: Conclusion
    claims: tuple[tuple[Results, FoundClaim], ...]
    missing: tuple[str, ...]
    """Experiments that have no results yet."""

    @property
    def verdict(self) -> Verdict:
        """What its claims say together."""
        verdicts = {claim.verdict for _, claim in self.claims}
        if not verdicts:
            return "not run" if self.missing else "open"
        if verdicts == {"holds"}:
            return "holds"
        if "does not hold" in verdicts:
            return "in part" if "holds" in verdicts else "does not hold"
        return "open"

    @property
    def parts(self) -> Mapping[str, tuple[str, ...]]:
        """Its claims by their verdict."""
        found = {v: tuple(c.claim for _, c in self.claims if c.verdict == v) for v in _PARTS}
        return {v: these for v, these in found.items() if these}

    def explained(self) -> str:
        """Return the verdict in words, and what it comes from where its claims differ."""
        if len(self.parts) < 2:
            return f"Verdict: {self.verdict}."
        said = [f"{v.capitalize()}: {'; '.join(these)}." for v, these in self.parts.items()]
        return " ".join([f"Verdict: {self.verdict}.", *said])


_PARTS = ("holds", "does not hold", "open")


def conclusions() -> tuple[Conclusion, ...]:
    """Return what the thesis concludes, in its order."""
    text = (resources.files(__name__) / "conclusions.toml").read_text(encoding="utf-8")
    return msgspec.convert(tomllib.loads(text), _ConclusionsFile).conclusions


def keys_of(experiment: str) -> frozenset[str]:
    """Return the keys of the conclusions that an experiment tests."""
    return frozenset(each.key for each in conclusions() if experiment in each.experiments)


def read_all_results(laboratory: Path) -> dict[str, Results]:
    """Return the results of all experiments in the folder ``laboratory``, by name.

    Raises:
        UnusableInput: there is no such folder, no experiment was finished in it, or a file in it is not what an
            experiment leaves.

    """
    if not laboratory.is_dir():
        raise UnusableInput(f"{laboratory}: expected the folder of a laboratory; run an experiment with --out first")
    found = {}
    for path in sorted(laboratory.glob(f"*/{RESULTS}")):
        try:
            results = msgspec.json.decode(read_bytes(path, "results of an experiment"), type=Results)
        except (msgspec.DecodeError, RecursionError) as error:
            raise UnusableInput(f"{path}: expected results of an experiment ({error}); run it again") from error
        found[results.experiment] = results
    if not found:
        raise UnusableInput(
            f"{laboratory}: expected experiments with results; finish one first, as by pneumarm experiment "
            f"{next(iter(PLACES))} --out {laboratory}"
        )
    return found


def judge(results: Mapping[str, Results]) -> list[Judged]:
    """Return every conclusion of the thesis with the claims on it.

    Claims about none that names their experiment follow under the experiment's own question, so that nothing that was
    found is left out.
    """
    listed = conclusions()
    judged = [
        Judged(
            conclusion,
            tuple(
                (results[name], claim)
                for name in conclusion.experiments
                if name in results
                for claim in results[name].claims
                if claim.about == conclusion.key
            ),
            tuple(name for name in conclusion.experiments if name not in results),
        )
        for conclusion in listed
    ]
    shown = {id(claim) for each in judged for _, claim in each.claims}
    for name, found in results.items():
        left = tuple((found, claim) for claim in found.claims if id(claim) not in shown)
        if left and name in PLACES:
            chosen = experiment(name)
            judged.append(Judged(Conclusion(name, chosen.words.source, chosen.words.question, (name,)), left, ()))
    return judged


def sections(judged: Sequence[Judged], laboratory: Path) -> list[Section]:
    """Return the sections of the page: all verdicts, the evidence for each, and what was not run yet."""
    overview = Table(
        ["conclusion of the thesis", "section", "verdict", "claims that hold", "refuted", "open"],
        [
            [
                each.conclusion.says,
                each.conclusion.section,
                each.verdict,
                *(str(sum(c.verdict == v for _, c in each.claims)) for v in ("holds", "does not hold", "open")),
            ]
            for each in judged
        ],
        "What the thesis concludes, and whether it holds here.",
        words=True,
    )
    made = [Section("Verdicts", _RULES, tables=[overview])]
    made += [_evidence(each) for each in judged if each.claims]
    missing = list(dict.fromkeys(name for each in judged for name in each.missing))
    few = {r.experiment: r for each in judged for r, _ in each.claims if not r.enough}
    if missing or few:
        rows = [[name, "no results", f"pneumarm experiment {name} --out {laboratory}"] for name in missing]
        rows += [[name, r.sample, _more(name, laboratory)] for name, r in few.items()]
        table = Table(["experiment", "what there is", "command"], rows, "What would make the page whole.", words=True)
        made.append(
            Section(
                "Still to be run",
                [f"A claim should rest on {FEWEST_ARMS} arms and {FEWEST_RUNS} runs at least."],
                tables=[table],
            )
        )
    return made


_RULES = (
    "A claim holds, or does not hold, where the 95 % interval of what was found lies on one side of what is claimed; "
    "else it is open. Runs on one arm share its simulation, so intervals are over arms.",
    "A conclusion holds where all its claims do. It does not hold where one is refuted and none holds, and holds in "
    "part where some hold and some are refuted; otherwise it is open. Of twenty claims that are neither true nor "
    "false one is judged by chance.",
)
HEADER = ("claim", "thesis", "here, with 95 % intervals", "from", "verdict")


def evidence(judged: Judged) -> list[list[str]]:
    """Return a line for each claim, by :data:`HEADER`: thesis beside ours, arms and runs, verdict."""
    return [
        [claim.claim, claim.thesis, claim.ours, f"{results.experiment}: {results.sample}", claim.verdict]
        for results, claim in judged.claims
    ]


def as_markdown(judged: Sequence[Judged]) -> str:
    """Return everything as a table for a note or a paper: a line for each conclusion and below it its claims."""
    lines = [f"| {' | '.join(HEADER)} |", "|---" * len(HEADER) + "|"]
    for each in judged:
        missing = ", ".join(each.missing)
        cells = [f"**{each.conclusion.says}**", each.conclusion.section, "", missing and f"missing: {missing}"]
        rows = [[*cells, f"**{each.verdict}**"], *evidence(each)]
        lines += [f"| {' | '.join(cell.replace('|', '&#124;') for cell in row)} |" for row in rows]
    return "\n".join(lines)


def _evidence(judged: Judged) -> Section:
    table = Table(
        list(HEADER),
        evidence(judged),
        f"Thesis section {judged.conclusion.section.removeprefix('Thesis section ')}.",
        words=True,
    )
    return Section(judged.conclusion.says, [judged.explained()], tables=[table])


def _more(name: str, laboratory: Path) -> str:
    own = experiment(name).arms
    arms = ",".join(own if len(own) >= FEWEST_ARMS else (f"virtual:seed={n}" for n in range(1, FEWEST_ARMS + 1)))
    runs = -(-FEWEST_RUNS // FEWEST_ARMS)
    return f"pneumarm experiment {name} --out {laboratory} --arms {arms} --runs {runs}"


def summary(judged: Sequence[Judged]) -> list[str]:
    """Return in words how many conclusions hold."""
    order: tuple[Verdict, ...] = ("holds", "in part", "does not hold", "open", "not run")
    counts = {verdict: sum(each.verdict == verdict for each in judged) for verdict in order}
    words = {
        "holds": ("holds", "hold"),
        "in part": ("holds in part", "hold in part"),
        "does not hold": ("does not hold", "do not hold"),
        "open": ("is open", "are open"),
        "not run": ("was not tested yet", "were not tested yet"),
    }

    def told(count: int, verdict: Verdict) -> str:
        return f"{count} {words[verdict][count != 1]}"

    said = ", ".join(told(count, verdict) for verdict, count in counts.items() if count)
    claims = [claim for each in judged for _, claim in each.claims]
    holding = sum(claim.verdict == "holds" for claim in claims)
    refuted = sum(claim.verdict == "does not hold" for claim in claims)
    return [
        f"Of {len(judged)} conclusions {said}. They rest on {len(claims)} claims: {told(holding, 'holds')}, "
        f"{told(refuted, 'does not hold')}, {told(len(claims) - holding - refuted, 'open')}. All of it is made "
        "from the results of the experiments."
    ]


def claims_figures(judged: Sequence[Judged]) -> dict[str, Any]:
    """Return for programs what the page says."""
    return {
        "conclusions": [
            {
                **msgspec.to_builtins(each.conclusion),
                "verdict": each.verdict,
                "missing": list(each.missing),
                "claims": [
                    {
                        **msgspec.to_builtins(claim),
                        "arms": len(results.arms),
                        "runs": len(results.arms) * results.runs,
                    }
                    for results, claim in each.claims
                ],
            }
            for each in judged
        ]
    }
