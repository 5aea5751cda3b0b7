import sys
from pathlib import Path

# For the toy experiment and the synthetic arm, which are no packages.
sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1] / "learning")]
