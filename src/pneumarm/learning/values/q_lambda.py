"""Q(lambda): values of actions under the best policy, whatever is tried (section 4.2.4, eq. 4.10; 4.2.5).

    choose a in s by the policy
    repeat: take a, see r and s'; choose a' in s' by the policy
        delta = r + gamma max_b Q(s', b) - Q(s, a)
        e(s, a) = e(s, a) + 1, or 1
        Q = Q + beta delta e;  e = gamma lambda e if a' is greedy, else 0;  s, a = s', a'
    until s' is a goal or the episode is cut off

Source: C. J. C. H. Watkins, Learning from delayed rewards, 1989; Sutton and Barto, Reinforcement Learning, section
12.10.
"""

from dataclasses import dataclass
from typing import Annotated, Literal

from pneumarm.kernels import part
from pneumarm.learning.online.exploration import greedy
from pneumarm.learning.values.settings import ValueSettings
from pneumarm.settings import PythonOnly


@dataclass(frozen=True)
class QSettings(ValueSettings):
    """Q(lambda)."""

    rule: Annotated[Literal["q-lambda"], PythonOnly] = "q-lambda"
    """Its name."""


@part
def look_ahead_q(values, chosen):  # type: ignore[no-untyped-def]
    """Return the highest of ``values`` (choices,), and whether traces are cut as less was ``chosen``."""
    best = values[greedy(values)]
    return float(best), values[chosen] < best
