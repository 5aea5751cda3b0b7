"""From a bare arm to a controller that moves it, with a picture: about a minute, or less with --quick.

Writes arm.db, arm.sim, arm.agent and movements.png into the current folder.
"""

import sys

import matplotlib.pyplot as plt

import pneumarm
from pneumarm.learning import LearnSettings, ServoSettings

ARM = "virtual:seed=7"  # or serial:/dev/ttyACM0

print(pneumarm.collect(ARM, "arm.db", transitions=9_000))  # eight minutes of the arm's time
fitted = pneumarm.fit("arm.db", "arm.sim")
print(fitted)
quick = LearnSettings(servo=ServoSettings(agents=1, updates=200)) if "--quick" in sys.argv else None
training = pneumarm.train(fitted, "arm.db", "arm.agent", settings=quick)
moved = pneumarm.move(training.agent, ARM, goals_deg=[20, -5, 10])

figure, axes = plt.subplots(1, len(moved), sharey=True, figsize=(9, 3))
for axis, one in zip(axes, moved, strict=True):
    print(one)
    axis.axhline(one.goal_degrees[0], color="grey", linestyle="dashed")
    axis.plot(one.time, one.degrees)
    axis.set_xlabel("time [s]")
axes[0].set_ylabel("angle [degrees]")
figure.savefig("movements.png")
