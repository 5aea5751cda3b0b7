"""pneumarm: learn to control an arm moved by pneumatic muscles, from its own recordings.

From nothing to an arm that moves where you say; ``serial:/dev/ttyACM0`` in the place of ``virtual:seed=7`` is yours:

    import pneumarm

    pneumarm.collect("virtual:seed=7", "arm.db", transitions=9_000)
    fitted = pneumarm.fit("arm.db", "arm.sim")
    training = pneumarm.train(fitted, "arm.db", "arm.agent")
    print(pneumarm.move(training.agent, "virtual:seed=7", goals_deg=[20, -5]))

``pneumarm --help`` lists the same and more as commands.
"""

from pneumarm.api import collect, fit, load_controller, move, open_arm, test, track, train, tune
from pneumarm.version import __version__ as __version__

__all__ = ["collect", "fit", "load_controller", "move", "open_arm", "test", "track", "train", "tune"]
