"""The thesis' conclusions and what holds here, from the rows of a laboratory's experiments.

    pneumarm claims --out laboratory

``conclusions.toml`` says what the thesis concludes and which experiments test it; what the rows of an experiment
say of it is judged by the rules of today, whichever version computed them (:mod:`.running`, :mod:`.page`).

How claims are judged, and add up to the verdict on a conclusion, says :mod:`~pneumarm.experiments.verdict`. What was
not run counts as undecided.
"""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

import msgspec

from pneumarm.experiments.experiment import Claim
from pneumarm.experiments.registry import PLACES, experiment
from pneumarm.experiments.results import Results, claim_figures, claim_row
from pneumarm.experiments.verdict import FEWEST_ARMS, OPEN, VERDICTS, Verdict, counted, holm, together


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


@dataclass(frozen=True)
class Judged:
    """A conclusion with the claims that were found on it."""

    conclusion: Conclusion
    claims: tuple[tuple[Results, Claim], ...]
    missing: tuple[str, ...]
    """Experiments that have no results yet."""

    @property
    def verdict(self) -> Verdict:
        """What its claims say together; experiments that were not run decide nothing yet."""
        return together([*(claim.verdict for _, claim in self.claims), *(OPEN for _ in self.missing)] or [OPEN])

    @property
    def parts(self) -> Mapping[str, tuple[str, ...]]:
        """Its claims by their verdict."""
        found = {v: tuple(c.text for _, c in self.claims if c.verdict == v) for v in VERDICTS}
        return {v: these for v, these in found.items() if these}

    @property
    def arms(self) -> int:
        """Most arms that any of its claims rests on."""
        return max((len(results.arms) for results, _ in self.claims), default=0)

    def explained(self) -> str:
        """Return the verdict in words, what it comes from where its claims differ, and what would decide the rest."""
        said = [f"{v.capitalize()}: {'; '.join(these)}." for v, these in self.parts.items() if len(self.parts) > 1]
        if not (self.claims or self.missing or self.conclusion.lacks):
            said.append(f"Nothing was found that bears on it; {FEWEST_ARMS} arms at least are needed.")
        if self.missing:
            said.append(f"Not run: {', '.join(self.missing)}; {FEWEST_ARMS} arms at least are needed.")
        if needed := max((claim.judgement.arms for _, claim in self.claims), default=0):
            said.append(f"{needed:,} arms would decide all that is open, by the spread found.")
        said += [f"What would decide it: {self.conclusion.lacks}."] if self.conclusion.lacks else []
        return " ".join([f"Verdict: {self.verdict}.", *said])


def conclusions() -> tuple[Conclusion, ...]:
    """Return what the thesis concludes, in its order."""
    text = (resources.files(__name__) / "conclusions.toml").read_text(encoding="utf-8")
    return tuple(msgspec.convert({"key": key, **each}, Conclusion) for key, each in tomllib.loads(text).items())


def keys_of(experiment: str) -> frozenset[str]:
    """Return the keys of the conclusions that an experiment tests."""
    return frozenset(each.key for each in conclusions() if experiment in each.experiments)


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


def summary(judged: Sequence[Judged]) -> list[str]:
    """Return in words how many conclusions hold."""
    said = counted([each.verdict for each in judged], "conclusion").capitalize()
    of = counted([claim.verdict for _, claim in _all_claims(judged)], "claim")
    alone = {name for r, _ in _all_claims(judged) if len(r.arms) == 1 for name in r.arms}
    speaks = [f"What rests on one arm speaks of that arm alone: {', '.join(sorted(alone))}."] if alone else []
    return [f"{said}. They rest on {of}. All of it is made from the results of the experiments.", *speaks]


def _all_claims(judged: Sequence[Judged]) -> list[tuple[Results, Claim]]:
    return [pair for each in judged for pair in each.claims]


def multiplicity(judged: Sequence[Judged]) -> str:
    """Return in words how many claims are judged, and how many verdicts stand when all are to be right at once."""
    decided = [claim for _, claim in _all_claims(judged) if claim.verdict in ("holds", "does not hold")]
    stand = sum(holm([claim.judgement.p for claim in decided]))
    return (
        f"{len(_all_claims(judged))} claims are judged one by one, each with an error of 2.5 %: of forty that chance "
        f"alone decides one is wrong. Of the {len(decided)} that hold or are refuted {stand} also stand by their "
        "means when all are to be right at once (Holm's correction). A conclusion holds, or is refuted, only where "
        "all of its claims are: no single one decides it by chance."
    )


HEADER = ("claim", "thesis", "here, with 95 % intervals", "from", "verdict")


def evidence(judged: Judged) -> list[list[str]]:
    """Return a line for each claim, by :data:`HEADER`: thesis beside ours, arms and runs, verdict."""
    lines = []
    for results, claim in judged.claims:
        text, _, thesis, ours, _, _ = claim_row(claim)
        lines.append([text, thesis, ours, f"{results.experiment}: {results.sample}", claim.short])
    return lines


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
                        **claim_figures(claim),
                        "arms": len(results.arms),
                        "runs": len(results.arms) * results.runs,
                    }
                    for results, claim in each.claims
                ],
            }
            for each in judged
        ]
    }
