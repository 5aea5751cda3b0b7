"""Draw the figures of the README from a finished run: ``python docs/figures.py runs/first``."""

import sys
from pathlib import Path

from pneumarm.report import read_run
from pneumarm.report.figures import movement
from pneumarm.report.style import svg

if __name__ == "__main__":
    run = read_run(Path(sys.argv[1]))
    shown = run.movements[-1]
    figure = movement(shown.time, shown.angle, shown.pressure, shown.valves, shown.goal, shown.end, run.spec)
    (Path(__file__).parent / "movement.svg").write_text(svg(figure), encoding="utf-8")
