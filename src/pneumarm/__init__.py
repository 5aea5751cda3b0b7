"""pneumarm: learn to control an arm moved by pneumatic muscles, from its own recordings."""

from pneumarm.api import collect, fit, load_controller, move, open_arm, test, track, train, tune

__all__ = ["collect", "fit", "load_controller", "move", "open_arm", "test", "track", "train", "tune"]

__version__ = "0.1.0"
