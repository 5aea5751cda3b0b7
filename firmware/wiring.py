"""Draw how the board is wired: ``python firmware/wiring.py`` writes ``wiring.svg`` beside it.

The pins come from the table in PROTOCOL.md, so that the drawing cannot tell another story.
"""

import re
from html import escape
from pathlib import Path

HERE = Path(__file__).parent
INK, AIR, FAINT, PAPER = "#1a1a1a", "#0072b2", "#8a8a8a", "#ffffff"
FONT = "font-family='Helvetica, Arial, sans-serif'"


class Drawing:
    """Lines, boxes and words on a sheet; lengths in pixels."""

    def __init__(self, width: int, height: int) -> None:
        self.size = width, height
        self.parts: list[str] = []

    def line(self, *points: tuple[float, float], color: str = INK, width: float = 1.6, dash: str = "") -> None:
        """Draw a line through points."""
        path = " ".join(f"{x:g},{y:g}" for x, y in points)
        dashed = f" stroke-dasharray='{dash}'" if dash else ""
        self.parts.append(
            f"<polyline points='{path}' fill='none' stroke='{color}' stroke-width='{width:g}'{dashed}/>"
        )

    def box(self, x: float, y: float, width: float, height: float, *, color: str = INK, fill: str = PAPER) -> None:
        """Draw a rectangle."""
        self.parts.append(
            f"<rect x='{x:g}' y='{y:g}' width='{width:g}' height='{height:g}' rx='3' fill='{fill}' "
            f"stroke='{color}' stroke-width='1.6'/>"
        )

    def dot(self, x: float, y: float, color: str = INK) -> None:
        """Draw a junction."""
        self.parts.append(f"<circle cx='{x:g}' cy='{y:g}' r='3.2' fill='{color}'/>")

    def shape(self, *points: tuple[float, float], fill: str = INK) -> None:
        """Draw a filled polygon."""
        path = " ".join(f"{x:g},{y:g}" for x, y in points)
        self.parts.append(f"<polygon points='{path}' fill='{fill}' stroke='{INK}' stroke-width='1.2'/>")

    def text(
        self,
        x: float,
        y: float,
        words: str,
        *,
        size: float = 13,
        at: str = "start",
        bold: bool = False,
        color: str = INK,
    ) -> None:
        """Write words; ``at`` is the side of (x, y) on which they begin."""
        weight = " font-weight='bold'" if bold else ""
        self.parts.append(
            f"<text x='{x:g}' y='{y:g}' font-size='{size:g}' text-anchor='{at}' fill='{color}' {FONT}{weight}>"
            f"{escape(words)}</text>"
        )

    def svg(self) -> str:
        """Return the sheet as SVG."""
        width, height = self.size
        head = (
            f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {width} {height}' "
            f"width='{width}' height='{height}'>"
        )
        paper = f"<rect width='{width}' height='{height}' fill='{PAPER}'/>"
        return "\n".join([head, paper, *self.parts, "</svg>", ""])


def pins() -> list[tuple[str, str]]:
    """Return the pins of the board and their meanings."""
    section = (HERE / "PROTOCOL.md").read_text(encoding="utf-8").split("\n## Pins\n")[1].split("\n## ")[0]
    return re.findall(r"^\| ([AD]\d+) \| \w+ \| (.+?) \|$", section, re.MULTILINE)


def resistor(d: Drawing, x: float, y: float, *, upright: bool) -> None:
    """Draw a resistor centred at (x, y)."""
    if upright:
        d.box(x - 6, y - 16, 12, 32)
    else:
        d.box(x - 16, y - 6, 32, 12)


def ground(d: Drawing, x: float, y: float) -> None:
    """Draw a ground symbol hanging at (x, y)."""
    for i, half in enumerate((11, 7, 3)):
        d.line((x - half, y + 4 * i), (x + half, y + 4 * i))


def air(d: Drawing, left: float, top: float) -> None:
    """Draw the air of one muscle, which is the first safety."""
    d.text(left, top, "1. The air of one muscle (of four)", size=15, bold=True)
    middle, boxes = top + 70, ("filter,|pressure|regulator", "|relief|valve", "inlet|normally|CLOSED")
    d.text(left, middle - 2, "compressor", size=12)
    d.line((left, middle + 8), (left + 80, middle + 8), color=AIR, width=3)
    for i, words in enumerate(boxes):
        x = left + 80 + 105 * i
        d.box(x, middle - 28, 80, 72, color=AIR)
        for row, word in enumerate(words.split("|")):
            d.text(x + 40, middle - 6 + 17 * row, word, at="middle", size=12, bold=word.isupper())
        d.line((x + 80, middle + 8), (x + 105, middle + 8), color=AIR, width=3)
    junction = left + 410
    d.line((junction - 15, middle + 8), (junction + 40, middle + 8), color=AIR, width=3)
    d.dot(junction, middle + 8, AIR)
    d.parts.append(
        f"<ellipse cx='{junction + 85:g}' cy='{middle + 8:g}' rx='46' ry='20' "
        f"fill='{PAPER}' stroke='{AIR}' stroke-width='2'/>"
    )
    d.text(junction + 85, middle + 12, "muscle", at="middle")
    d.line((junction, middle + 8), (junction, middle + 72), color=AIR, width=3)
    d.box(junction - 40, middle + 72, 80, 54, color=AIR)
    for row, word in enumerate(("exhaust", "normally", "OPEN")):
        d.text(junction, middle + 88 + 16 * row, word, at="middle", size=12, bold=word.isupper())
    d.line((junction, middle + 126), (junction, middle + 150), color=AIR, width=3)
    d.text(junction + 10, middle + 150, "silencer", size=12)
    d.line((junction + 85, middle + 28), (junction + 85, middle + 72), color=AIR, width=1.6)
    d.box(junction + 52, middle + 72, 72, 40, color=AIR)
    d.text(junction + 88, middle + 89, "pressure", at="middle", size=12)
    d.text(junction + 88, middle + 104, "sensor", at="middle", size=12)
    d.text(left, middle + 84, "No current: inlet closed, exhaust open,", size=12)
    d.text(left, middle + 101, "the muscle is vented.", size=12)
    d.text(left, middle + 126, "The sensor sits at the muscle, on a tube", size=12)
    d.text(left, middle + 143, "of its own: at the valve it overshoots.", size=12)


def driver(d: Drawing, left: float, top: float) -> None:
    """Draw the driver of one valve."""
    d.text(left, top, "2. The driver of one valve (of eight)", size=15, bold=True)
    gate, bottom, drain = top + 150, top + 212, left + 205
    d.text(left, gate + 5, "D4 … D11", bold=True)
    d.line((left + 66, gate), (left + 84, gate))
    resistor(d, left + 100, gate, upright=False)
    d.text(left + 100, gate - 13, "220 Ω", at="middle", size=12)
    d.line((left + 116, gate), (drain - 27, gate))
    d.dot(left + 142, gate)
    d.line((left + 142, gate), (left + 142, gate + 15))
    resistor(d, left + 142, gate + 31, upright=True)
    d.text(left + 130, gate + 36, "10 kΩ pull-down", at="end", size=12)
    d.line((left + 142, gate + 47), (left + 142, bottom))
    ground(d, left + 142, bottom)
    # The transistor: gate, channel, drain above, source below.
    d.line((drain - 27, gate - 14), (drain - 27, gate + 14))
    d.line((drain - 20, gate - 18), (drain - 20, gate + 18), width=3)
    d.line((drain - 20, gate - 13), (drain, gate - 13), (drain, top + 98))
    d.line((drain - 20, gate + 13), (drain, gate + 13), (drain, bottom))
    d.shape((drain - 19, gate + 13), (drain - 9, gate + 8), (drain - 9, gate + 18))
    ground(d, drain, bottom)
    d.text(drain + 14, gate + 2, "logic-level", size=12)
    d.text(drain + 14, gate + 17, "N-channel MOSFET", size=12)
    # The valve's coil with its diode, between the supply and the drain.
    d.line((drain, top + 98), (drain, top + 92))
    d.box(drain - 22, top + 54, 44, 38)
    d.text(drain, top + 77, "valve", at="middle", size=12)
    d.line((drain, top + 54), (drain, top + 30))
    d.text(drain, top + 23, "+12 or 24 V, as the valve wants", at="middle", size=12)
    diode = drain + 62
    d.line((drain, top + 40), (diode, top + 40), (diode, top + 62))
    d.line((drain, top + 104), (diode, top + 104), (diode, top + 82))
    d.dot(drain, top + 40)
    d.dot(drain, top + 104)
    d.line((diode - 10, top + 64), (diode + 10, top + 64), width=2.4)
    d.shape((diode, top + 65), (diode - 10, top + 82), (diode + 10, top + 82))
    d.text(diode + 18, top + 78, "1N4007", size=12)
    d.text(left, bottom + 38, "The pull-down keeps the valve off while the board", size=12)
    d.text(left, bottom + 54, "resets, is being flashed or has no program.", size=12)


def board(d: Drawing, left: float, top: float, width: float) -> None:
    """Draw the board with all its pins."""
    d.text(left, top, "3. The board: Arduino Nano or Uno (ATmega328P, 16 MHz, 5 V)", size=15, bold=True)
    found = pins()
    analog = [pin for pin in found if pin[0].startswith("A")]
    digital = [pin for pin in found if pin[0].startswith("D")]
    pitch, head = 24, top + 24
    height = pitch * (max(len(analog), len(digital)) + 1) + 20
    x, wide = left + width / 2 - 95, 190
    d.box(x, head, wide, height, fill="#f2f2f2")
    d.text(x + wide / 2, head + height / 2 - 6, "Nano / Uno", at="middle", bold=True, size=15)
    d.text(x + wide / 2, head + height / 2 + 14, "USB to the host", at="middle", size=12)
    for side, listed in ((-1, analog), (1, digital)):
        edge = x if side < 0 else x + wide
        for i, (name, meaning) in enumerate(listed):
            y = head + 26 + pitch * i
            d.line((edge, y), (edge + side * 36, y))
            d.text(edge - side * 8, y + 4, name, at="start" if side < 0 else "end", bold=True, size=12)
            d.text(edge + side * 44, y + 4, meaning.split(":")[0], at="end" if side < 0 else "start", size=12)
    y = head + 26 + pitch * len(analog)
    for i, (name, meaning) in enumerate(
        (("5V", "top of the potentiometers, supply of the sensors"), ("GND", "one ground for everything"))
    ):
        d.line((x, y + pitch * i), (x - 36, y + pitch * i))
        d.text(x + 8, y + 4 + pitch * i, name, bold=True, size=12)
        d.text(x - 44, y + 4 + pitch * i, meaning, at="end", size=12)
    below = head + height + 24
    for i, words in enumerate(
        (
            "Angle: potentiometer of 1 to 10 kΩ, linear, its ends at 5V and GND, its wiper at the pin; "
            "100 nF from each analog pin to GND, at the board.",
            "Pressure: a gauge sensor with 0 to 5 V or 0.5 to 4.5 V. Inputs without a sensor go to GND. "
            "D2, D3 and D12 stay free.",
            "The valves' supply is another one than the board's; only the grounds meet, "
            "at one point near the transistors.",
        )
    ):
        d.text(left, below + 18 * i, words, size=12)


def main() -> None:
    """Write the drawing."""
    d = Drawing(1000, 720)
    air(d, 30, 34)
    d.line((605, 20), (605, 305), color=FAINT, width=1)
    driver(d, 630, 34)
    d.line((30, 318), (970, 318), color=FAINT, width=1)
    board(d, 30, 350, 940)
    (HERE / "wiring.svg").write_text(d.svg(), encoding="utf-8")


if __name__ == "__main__":
    main()
