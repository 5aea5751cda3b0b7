"""Check that on docs/claims.md each verdict's sentence, its numbers and its picture agree.

    python tools/check_claims.py [FOLDER]

It reads the page and its SVGs as a person would, and knows nothing of what makes them: numbers are compared with the
bounds that the page says were stated, lines in the pictures with the shaded area, and both with the verdict in words.
It ends with 1 and a line for each disagreement.
"""

import math
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

SVG = "{http://www.w3.org/2000/svg}"
COLOURS = {"#12476b": "holds", "#dcb24c": "in part", "#d1602b": "does not hold", "#8a8a8a": "cannot be decided"}
NUMBER = r"[+-]?\d[\d,]*(?:\.\d+)?(?:e[+-]?\d+)?"


def numbers(text: str) -> list[tuple[float, float]]:
    """Return the numbers in ``text``, each with the half of its last digit."""
    found = re.findall(NUMBER, text.replace("−", "-"))
    return [(float(one.replace(",", "")), 0.51 * 10.0 ** -len(one.partition(".")[2])) for one in found]


def bounds(stated: str, verb: str) -> tuple[float, float]:
    """Return the bounds after ``verb`` ("holds" or "refuted"): above the first, below the second."""
    part = stated.replace("−", "-").partition(verb)[2].split(",")[0].split(";")[0]
    above, below = (re.search(rf"{word} ({NUMBER})", part) for word in ("above", "below"))
    return float(above[1]) if above else math.nan, float(below[1]) if below else math.nan


def region(mean: float, half: float, stated: str, room: float) -> set[str]:
    """Return what an interval says of what was ``stated``; all that rounding by ``room`` allows."""
    low, high = bounds(stated, "holds")
    most, least = bounds(stated, "refuted")
    said = set()
    for shift in (-room, 0.0, room):  # a bound that there is not is not a number, and neither reached nor passed
        below, above = mean - half - shift, mean + half + shift
        inside = not (below <= low) and not (above >= high)
        outside = above < least or below > most
        said.add(
            ("in part" if inside else "does not hold") if outside else "holds" if inside else "cannot be decided"
        )
    return said


def together(verdicts: set[str]) -> str:
    """Return what several verdicts say of the whole."""
    if len(verdicts) == 1:
        return next(iter(verdicts))
    return "in part" if verdicts & {"holds", "in part"} else "cannot be decided"


def claims(group: ElementTree.Element, stated: str, ours: str) -> Iterator[str | set[str]]:
    """Give for the mean and the median in a ``group`` of a picture what they say, and what disagrees, in words."""
    zone = group.find(f"{SVG}rect")
    assert zone is not None
    left, right = float(zone.attrib["x"]), float(zone.attrib["x"]) + float(zone.attrib["width"])
    for line in group.iter(f"{SVG}line"):
        name = line.attrib.get("class")
        if name is None:
            continue
        (said,) = (t.text or "" for t in group.iter(f"{SVG}text") if (t.text or "").startswith(name))
        (mean, room), (half, _) = (*numbers(said), (0.0, 0.0))[:2]
        seen = float(line.attrib["x1"]) > left and float(line.attrib["x2"]) < right
        found = region(mean, half, stated, room)
        if seen not in {"holds" in one or one == "in part" for one in found if one}:
            yield f"the picture shows it {'inside' if seen else 'outside'} the bounds, the number is {said}"
        if name == "mean" and not any(
            abs(abs(mean) * factor - abs(one)) <= room * factor + near
            for one, near in numbers(ours)
            for factor in (1, 100)
        ):
            yield f"{said} is not in {ours!r}"
        yield found


def disagreements(folder: Path) -> Iterator[str]:
    """Give in words what disagrees on the page in ``folder``."""
    chart = ElementTree.parse(folder / "claims" / "overview.svg")
    colours = {a.attrib["href"].split("#")[1]: a.find(f"{SVG}circle") for a in chart.iter(f"{SVG}a")}
    parts = re.split(r'<a id="([\w-]+)"></a>', (folder / "claims.md").read_text(encoding="utf-8"))[1:]
    listed = dict(re.findall(r"^\| \[.*?\]\(#([\w-]+)\) \| [^|]* \| ([a-z ]+) \|", parts[1], re.MULTILINE))
    for key, text in zip(parts[2::2], parts[3::2], strict=True):
        if key == "replica":  # no conclusion of the thesis
            continue
        (said,) = re.findall(r"Verdict: ([a-z ]+)\.", text)
        if listed.pop(key, "") != said:
            yield f"{key}: {said}, another verdict in the table of all"
        circle = colours.pop(key)
        if circle is None or COLOURS[circle.attrib["fill"]] != said:
            yield f"{key}: {said} in words, another colour in the chart"
        rows = [
            [cell.strip() for cell in line.split(" | ")] for line in text.splitlines() if re.match(r"\| \d+\. ", line)
        ]
        found = {"cannot be decided"} if "Not run: " in text or not rows else set()
        found |= {row[-1].removesuffix(" |").split(":")[0] for row in rows}
        if together(found) != said:
            yield f"{key}: {said}, its claims say {together(found)}"
        drawn = folder / "claims" / f"{key}.svg"
        groups = list(ElementTree.parse(drawn).iter(f"{SVG}g")) if drawn.exists() else []
        for row in rows:
            number, verdict = row[0].removeprefix("| ").split(".")[0], row[-1].removesuffix(" |")
            of = [group for group in groups if group.attrib["data-claim"] == number]
            answers = [answer for group in of for answer in claims(group, row[1], row[3])]
            yield from (f"{key}, claim {number}: {answer}" for answer in answers if isinstance(answer, str))
            sets = [answer for answer in answers if isinstance(answer, set)]
            word = verdict.split(":")[0]
            told = word == "cannot be decided" and ("one arm" in verdict or "floor or ceiling" in verdict)
            if sets and not told and word not in _combinations(sets):
                yield f"{key}, claim {number}: {word}, its numbers say {' or '.join(_combinations(sets))}"
            for group in of:
                for line in group.iter(f"{SVG}line"):
                    if "class" in line.attrib and COLOURS[line.attrib["stroke"]] != word:
                        yield f"{key}, claim {number}: {word}, drawn in another colour"
    yield from (f"{key}: in the chart, not on the page" for key in {*colours, *listed})


def _combinations(sets: list[set[str]]) -> set[str]:
    """Return what the whole may be, where each part is one of a set."""
    made: set[frozenset[str]] = {frozenset()}
    for one in sets:
        made = {known | {verdict} for known in made for verdict in one}
    return {together(set(one)) for one in made}


if __name__ == "__main__":
    lines = list(disagreements(Path(sys.argv[1] if len(sys.argv) > 1 else "docs")))
    print("\n".join(lines) or "every verdict agrees with its numbers and its picture")
    sys.exit(bool(lines))
