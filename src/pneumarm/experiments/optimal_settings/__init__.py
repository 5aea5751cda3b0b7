"""The confirmation of the derived settings (section 5.4.2, appendix C.4).

The thesis derives SARSA, 5 neurons, lambda 0, gamma 0.98 and, by a slip, learning rate 0.05; its own rule gives 0.10,
which is trial 10 of all-goals. Both are confirmed here, with the weights of the runs of all-goals.

    pneumarm experiment optimal-settings
"""

from pneumarm.experiments.optimal_settings.confirmation import DerivedSettings

EXPERIMENT = DerivedSettings()
