"""How far healthy arms are from every limit of the check-up, and how many faults it finds on how many arms.

python -m benchmarks checkup
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pneumarm.arm import open_arm
from pneumarm.checkup import diagnose, joint_figures
from pneumarm.checkup import measure as check_up
from pneumarm.checkup.diagnose import LEAK, LEAP, LOGARITHMIC, WORN

ARMS = range(1, 21)
NOISES = 3
"""Check-ups of each healthy arm, with other noise."""
FAULTY_ARMS = range(1, 11)


def measure() -> Iterator[str]:
    """Yield lines with what was found on healthy arms, and then on faulty ones."""
    complaints, figures = 0, []
    for seed in ARMS:
        for noise in range(NOISES):
            checkup = check_up(open_arm(f"virtual:seed={seed}", 1000 * noise + seed))
            complaints += bool(diagnose(checkup))
            found = joint_figures(checkup, 0)
            muscles = found.muscles
            ratio = max(found.halves, 1 / found.halves)
            figures.append((max(m.leak for m in muscles), max(m.leap for m in muscles), ratio, found.worst))
    worst = np.max(figures, axis=0)
    yield f"healthy: {complaints} of {len(ARMS) * NOISES} check-ups complain"
    for name, value, limit in zip(
        ("leak [%/min]", "leap [bar]", "halves", "irregularity [counts]"),
        worst,
        (LEAK, LEAP, LOGARITHMIC, WORN),
        strict=True,
    ):
        yield f"  worst {name}: {value:.3g}, limit {limit:g}"
    sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
    from faulty_arm import FAULTS

    for fault, make in FAULTS.items():
        kinds = [{finding.kind for finding in diagnose(check_up(make(seed)))} for seed in FAULTY_ARMS]
        found_, alone = sum(fault in k for k in kinds), sum(k == {fault} for k in kinds)
        yield f"{fault}: found on {found_} of {len(kinds)} arms, and nothing else on {alone}"
