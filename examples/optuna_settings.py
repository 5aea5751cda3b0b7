"""Look for settings of the default agent with Optuna, judged in the simulation of first.py.

Needs arm.db and arm.sim of first.py, and ``pip install 'pneumarm[tuning]'``. Writes best.toml, which
``pneumarm train arm.sim arm.db --out arm.agent --config best.toml`` uses.
"""

import sys
from pathlib import Path

try:
    import optuna
except ImportError as error:
    sys.exit(f"{error}: pip install 'pneumarm[tuning]'")

import pneumarm
from pneumarm.learning import LearnSettings, ServoSettings

trials, updates = (2, 50) if "--quick" in sys.argv else (30, 400)


def settled(trial: optuna.Trial) -> float:
    """Return which share of its movements a small agent with the settings of ``trial`` settles in."""
    chosen = {
        "learning_rate": trial.suggest_float("learning_rate", 1e-4, 1e-2, log=True),
        "precision": trial.suggest_float("precision", 0.1, 3.0, log=True),
        "change": trial.suggest_float("change", 0.003, 0.3, log=True),
    }
    servo = ServoSettings(agents=1, updates=updates, **chosen)
    training = pneumarm.train("arm.sim", "arm.db", settings=LearnSettings(servo=servo))
    return float(training.curves[training.best][-1, training.columns.index("settled")])


optuna.logging.set_verbosity(optuna.logging.WARNING)
study = optuna.create_study(direction="maximize", sampler=optuna.samplers.TPESampler(seed=0))
study.optimize(settled, trials)
lines = [f"{name.replace('_', '-')} = {value!r}" for name, value in study.best_params.items()]
Path("best.toml").write_text("\n".join(["[train.servo]", *lines]) + "\n")
print(f"settled in {study.best_value:.1%} of the movements with {study.best_params}")
