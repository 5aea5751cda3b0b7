"""Draw the figures of the README from a finished run: ``python docs/figures.py runs/first``."""

import sys
from pathlib import Path

from pneumarm.drawing.moving_arm import moving_arm
from pneumarm.report.figures.film import movement
from pneumarm.report.run_report import read_run
from pneumarm.report.shown import read_shown
from pneumarm.report.style import svg
from pneumarm.report.thesis import GOAL_TOLERANCE

if __name__ == "__main__":
    docs, run = Path(__file__).parent, read_run(Path(sys.argv[1]))
    moved = read_shown(Path(sys.argv[1]), begin=6.0, seconds=12.0)
    for name, narrow in (("arm.svg", False), ("arm-narrow.svg", True)):
        (docs / name).write_text(moving_arm(moved, narrow=narrow), encoding="utf-8")
    shown = run.demonstrations[-1]
    figure = movement(shown.shown(run.spec), shown.seconds, tolerance=GOAL_TOLERANCE)
    (docs / "movement.svg").write_text(svg(figure), encoding="utf-8")
