"""The thesis' conclusions and what holds here, from the results of a laboratory's experiments.

    pneumarm claims --out laboratory

``conclusions.toml`` says what the thesis concludes and which experiments test it; what an experiment finds is in its
``results.json``. Nothing is run: an experiment without results is listed with the command that makes them.

How claims are judged, and add up to the verdict on a conclusion, says :mod:`~pneumarm.experiments.verdict`. What was
not run counts as undecided.
"""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import msgspec

from pneumarm.errors import UnusableInput
from pneumarm.experiments.registry import PLACES, experiment
from pneumarm.experiments.results import RESULTS, RULES, verdict_in_words
from pneumarm.experiments.verdict import OPEN, VERDICTS, Verdict, counted, holm, together
from pneumarm.files import read_bytes
from pneumarm.report.page import Section, Table

NOT_RUN = "not run"


class Conclusion(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Something that the thesis concludes."""

    key: str
    section: str
    """Section of the thesis."""
    says: str
    """What it concludes, in words."""
    experiments: tuple[str, ...] = ()
    """Experiments that test it."""
    lacks: str = ""
    """What would decide it, where no experiment does."""


class FoundClaim(msgspec.Struct, frozen=True):
    """A claim in ``results.json``."""

    claim: str
    thesis: str
    ours: str
    about: str
    stated: str
    medians: str
    verdict: Verdict
    why: str
    arms: int
    p: float

    @property
    def short(self) -> str:
        """Its verdict, and how many arms would decide it."""
        return f"{self.verdict} ({self.arms:,} arms would)" if self.arms else self.verdict


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
        return f"{arms} arm{'s' * (arms != 1)}, {arms * runs} run{'s' * (arms * runs != 1)}"


@dataclass(frozen=True)
class Judged:
    """A conclusion with the claims that were found on it."""

    conclusion: Conclusion
    claims: tuple[tuple[Results, FoundClaim], ...]
    missing: tuple[str, ...]
    """Experiments that have no results yet."""

    @property
    def verdict(self) -> str:
        """What its claims say together; experiments that were not run say nothing yet."""
        verdicts = [claim.verdict for _, claim in self.claims]
        if not verdicts:
            return NOT_RUN if self.missing else OPEN
        return together([*verdicts, *(OPEN for _ in self.missing)])

    @property
    def parts(self) -> Mapping[str, tuple[str, ...]]:
        """Its claims by their verdict."""
        found = {v: tuple(c.claim for _, c in self.claims if c.verdict == v) for v in VERDICTS}
        return {v: these for v, these in found.items() if these}

    def explained(self) -> str:
        """Return the verdict in words, and what it comes from where its claims differ."""
        said = [f"{v.capitalize()}: {'; '.join(these)}." for v, these in self.parts.items() if len(self.parts) > 1]
        said += [f"Not run: {', '.join(self.missing)}."] if self.missing else []
        said += [f"What would decide it: {self.conclusion.lacks}."] if self.conclusion.lacks else []
        return " ".join([f"Verdict: {self.verdict}.", *said])


def conclusions() -> tuple[Conclusion, ...]:
    """Return what the thesis concludes, in its order."""
    text = (resources.files(__name__) / "conclusions.toml").read_text(encoding="utf-8")
    return tuple(msgspec.convert({"key": key, **each}, Conclusion) for key, each in tomllib.loads(text).items())


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
        ["conclusion of the thesis", "section", "verdict", "claims that hold", "in part", "refuted", "undecided"],
        [
            [
                each.conclusion.says,
                each.conclusion.section,
                each.verdict,
                *(str(sum(c.verdict == v for _, c in each.claims)) for v in VERDICTS),
            ]
            for each in judged
        ],
        "What the thesis concludes, and whether it holds here.",
        words=True,
    )
    made = [Section("Verdicts", [RULES, _multiplicity(judged)], tables=[overview])]
    made += [_evidence(each) for each in judged if each.claims or each.conclusion.lacks]
    missing = list(dict.fromkeys(name for each in judged for name in each.missing))
    rows = [[name, "no results", f"pneumarm experiment {name} --out {laboratory}"] for name in missing]
    needed: dict[str, int] = {}
    for results, claim in _all_claims(judged):
        if claim.arms:
            needed[results.experiment] = max(claim.arms, needed.get(results.experiment, 0))
    for name, arms in needed.items():
        command = f"pneumarm experiment {name} --out {laboratory} --arms $(seq -f virtual:seed=%g -s , 1 {arms})"
        rows.append([name, f"{arms:,} arms would decide all of its claims", command])
    if rows:
        table = Table(["experiment", "what it lacks", "command"], rows, "What would decide more.", words=True)
        text = "Arms by the spread found: 95 % power at the size that matters to each claim."
        made.append(Section("Still to be run", [text], tables=[table]))
    return made


def _all_claims(judged: Sequence[Judged]) -> list[tuple[Results, FoundClaim]]:
    return [pair for each in judged for pair in each.claims]


def _multiplicity(judged: Sequence[Judged]) -> str:
    """Return in words how many claims are judged, and how many verdicts stand when all are to be right at once."""
    decided = [claim for _, claim in _all_claims(judged) if claim.verdict in ("holds", "does not hold")]
    stand = sum(holm([claim.p for claim in decided]))
    return (
        f"{len(_all_claims(judged))} claims are judged one by one, each with an error of 2.5 %: of forty that chance "
        f"alone decides one is wrong. Of the {len(decided)} that hold or are refuted {stand} also stand by their "
        "means when all are to be right at once (Holm's correction). A conclusion holds, or is refuted, only where "
        "all of its claims are: no single one decides it by chance."
    )


HEADER = ("claim", "thesis", "here, with 95 % intervals", "from", "verdict")


def evidence(judged: Judged) -> list[list[str]]:
    """Return a line for each claim, by :data:`HEADER`: thesis beside ours, arms and runs, verdict."""
    return [
        [claim.claim, claim.thesis, claim.ours, f"{results.experiment}: {results.sample}", claim.short]
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
    header = [HEADER[0], "stated beforehand", *HEADER[1:3], "by the medians", *HEADER[3:]]
    lines = [
        [text, claim.stated, thesis, ours, claim.medians, sample, verdict_in_words(claim.verdict, claim.why)]
        for (text, thesis, ours, sample, _), (_, claim) in zip(evidence(judged), judged.claims, strict=True)
    ]
    caption = f"Thesis section {judged.conclusion.section.removeprefix('Thesis section ')}."
    tables = [Table(header, lines, caption, words=True)] if lines else []
    return Section(judged.conclusion.says, [judged.explained()], tables=tables)


def summary(judged: Sequence[Judged]) -> list[str]:
    """Return in words how many conclusions hold."""
    said = counted([each.verdict for each in judged], "conclusion").capitalize()
    of = counted([claim.verdict for _, claim in _all_claims(judged)], "claim")
    alone = {name for r, _ in _all_claims(judged) if len(r.arms) == 1 for name in r.arms}
    speaks = [f"What rests on one arm speaks of that arm alone: {', '.join(sorted(alone))}."] if alone else []
    return [f"{said}. They rest on {of}. All of it is made from the results of the experiments.", *speaks]


def claims_figures(judged: Sequence[Judged]) -> dict[str, Any]:
    """Return for programs what the page says."""
    return {
        "conclusions": [
            {
                **msgspec.to_builtins(each.conclusion),
                "verdict": each.verdict,
                "explained": each.explained(),
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
