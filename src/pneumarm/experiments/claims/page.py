"""The page of claims, for a laboratory as HTML and published as Markdown, made of rows and nothing else.

    FOLDER/claims.md               the page
    FOLDER/claims/*.svg            its pictures: one of all conclusions, one of the claims on each
    FOLDER/claims/rows/            the rows that it is made of, an experiment a folder, as in a laboratory

``believe.toml`` says in plain English what to believe of the thesis. Each of its paragraphs names the verdicts that
it rests on, of conclusions or of claims on them (``frequency.1``), and is left out where they are others, so that no
sentence outlives its evidence.
"""

import tomllib
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path

from pneumarm.experiments.claims import HEADER, Judged, judge, multiplicity, summary
from pneumarm.experiments.claims.pictures import overview, strip
from pneumarm.experiments.claims.replica import replica
from pneumarm.experiments.claims.running import THESIS_LIKE, RowsByKind, results_of, rows_by_kind
from pneumarm.experiments.results import RULES, claim_row
from pneumarm.experiments.verdict import VERDICTS
from pneumarm.files import make_folder, write_text
from pneumarm.report.page import Picture, Section, Table

PAGE, PICTURES, ROWS = "claims.md", "claims", "claims/rows"
TITLE = "What holds of the thesis' conclusions"
_CHART = "overview"
Kinds = Mapping[str, Sequence[Judged]]
"""The same conclusions on other kinds of arms."""


def sections(judged: Sequence[Judged], kinds: Kinds | None = None) -> list[Section]:
    """Return the sections of the page: all verdicts, then the evidence for each."""
    kinds = kinds or {}
    header = ["conclusion of the thesis", "section", "verdict", *(f"{kind} arms" for kind in kinds)]
    rows = [
        [
            each.conclusion.says,
            each.conclusion.section,
            each.verdict,
            *(_of_kind(of_kind[place]) for of_kind in kinds.values()),
            *(str(sum(c.verdict == v for _, c in each.claims)) for v in VERDICTS),
        ]
        for place, each in enumerate(judged)
    ]
    caption = "What the thesis concludes, and whether it holds here; how many of the claims on it have each verdict."
    table = Table([*header, "claims that hold", "in part", "refuted", "undecided"], rows, caption, words=True)
    chart = Picture(overview(judged, ""), "Every conclusion of the thesis, by its verdict.", _counted(judged))
    made = [Section("Verdicts", [RULES, multiplicity(judged)], [chart], [table], opens=True)]
    for place, each in enumerate(judged):
        made.append(_evidence(each, {kind: of_kind[place] for kind, of_kind in kinds.items()}))
    return made


def _of_kind(judged: Judged) -> str:
    return f"{judged.verdict} ({judged.arms} arms)" if judged.claims else "not run"


def _counted(judged: Sequence[Judged]) -> str:
    return "; ".join(f"{each.conclusion.key}: {each.verdict}" for each in judged)


def _evidence(judged: Judged, kinds: Mapping[str, Judged]) -> Section:
    header = [HEADER[0], "stated beforehand", *HEADER[1:3], "by the medians", *HEADER[3:]]
    lines = []
    for number, (results, claim) in enumerate(judged.claims, 1):
        words, *cells, verdict = claim_row(claim)
        lines.append([f"{number}. {words}", *cells, f"{results.experiment}: {results.sample}", verdict])
    of = judged.conclusion
    run = " && ".join(f"pneumarm experiment {name} --out laboratory" for name in of.experiments)
    text = [f"Thesis section {of.section.removeprefix('Thesis section ')}. {judged.explained()}"]
    text += [
        f"On {kind} arms ({other.arms}): {other.verdict}. "
        + " ".join(f"{n}: {claim.short}." for n, (_, claim) in enumerate(other.claims, 1))
        for kind, other in kinds.items()
        if other.claims
    ]
    text += [f"To run it again: {run}"] if run else []
    drawn = strip(judged)
    caption = "Intervals over arms of the mean and of the median; what is shaded holds."
    pictures = [Picture(drawn, caption, judged.explained())] if drawn else []
    tables = [Table(header, lines, "Claims that test it.", words=True)] if lines else []
    return Section(of.says, text, pictures, tables)


def believed(judged: Sequence[Judged]) -> tuple[list[str], list[str]]:
    """Return the paragraphs of ``believe.toml`` that the verdicts support, and the keys whose verdict is another."""
    text = (resources.files(__package__) / "believe.toml").read_text(encoding="utf-8")
    verdicts: dict[str, str] = {each.conclusion.key: each.verdict for each in judged}
    for each in judged:
        found = enumerate(each.claims, 1)
        verdicts |= {f"{each.conclusion.key}.{number}": claim.verdict for number, (_, claim) in found}
    paragraphs, others = [], []
    for one in tomllib.loads(text)["paragraphs"]:
        wrong = [key for key, verdict in one["rests"].items() if verdicts.get(key) != verdict]
        others += wrong
        paragraphs += [] if wrong else [" ".join(one["text"].split())]
    return paragraphs, others


def judged_rows(rows: RowsByKind) -> tuple[list[Judged], dict[str, list[Judged]]]:
    """Return the conclusions as arms like the thesis' have them, or the first kind there is, and as the others do."""
    found = {kind: judge(results_of(of_kind)) for kind, of_kind in rows.items()}
    main = THESIS_LIKE if THESIS_LIKE in found else next(iter(found))
    return found.pop(main), found


def publish(folder: Path) -> list[str]:
    """Write the page and its pictures to ``folder`` from the rows in it; return the keys of :func:`believed`."""
    rows = rows_by_kind(folder / ROWS)
    judged, kinds = judged_rows(rows)
    paragraphs, others = believed(judged)
    make_folder(folder / PICTURES)
    for old in (folder / PICTURES).glob("*.svg"):
        old.unlink()
    made = sections(judged, kinds)
    lines = [f"# {TITLE}", *paragraphs, *summary(judged)]
    for key, section in zip([_CHART, *(each.conclusion.key for each in judged)], made, strict=True):
        lines += [f'<a id="{key}"></a>', f"## {section.title}", *section.text]
        for picture in section.figures:
            drawn = str(picture.figure) if key != _CHART else overview(judged, "../claims.html")
            write_text(folder / PICTURES / f"{key}.svg", drawn)
            file = f"{PICTURES}/{key}.svg"
            image = f'<img src="{file}" alt="{picture.caption}">'  # the chart's links work where it is an object
            lines.append(
                f'<object data="{file}" type="image/svg+xml">{image}</object>'
                if key == _CHART
                else f"![{picture.caption}]({file})"
            )
        linked = [each.conclusion.key for each in judged] if key == _CHART else []
        lines += [_table(table, linked) for table in section.tables]
    if (last := replica(rows.get(THESIS_LIKE, {}))) is not None:
        lines += [
            '<a id="replica"></a>',
            f"## {last.title}",
            *last.text,
            *(_table(table, []) for table in last.tables),
        ]
    write_text(folder / PAGE, "\n\n".join(lines) + "\n")
    return others


def _table(table: Table, linked: Sequence[str]) -> str:
    """Return a table as Markdown, the first cells of its rows as links to what they name."""
    rows = [[f"[{first}](#{key})", *rest] for (first, *rest), key in zip(table.rows, linked, strict=False)]
    every = [table.header, ["---"] * len(table.header), *(rows or table.rows)]
    return "\n".join(f"| {' | '.join(cell.replace('|', '&#124;') for cell in row)} |" for row in every)
