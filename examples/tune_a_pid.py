"""Tune a classical controller on the arm and move by it. It takes minutes of the arm's time and no simulation."""

import pneumarm
from pneumarm.classical import TuneSettings

ARM = "virtual:seed=7"

tuned = pneumarm.tune("pid", ARM, "arm.pid", settings=TuneSettings(seconds=300))
print(tuned)
print(", ".join(f"{name} {gain:.3g}" for name, gain in vars(tuned.gains).items()))
for one in pneumarm.move("arm.pid", ARM, goals_deg=[20, -5, 10]):
    print(one)
