"""The settings of shaping (sections 4.3.2 and 5.4.4): which matter, and when is shaping indispensable?

One setting at a time is changed from the thesis': how much the deviation grows and shrinks, how often, which begin
states are drawn, how much is explored; then no shaping at all (epsilon 0.09 and T 10, as in 5.4.4). The thesis says
that shaping was indispensable while the potentiometer was worn: both are done again with a worn one.

    pneumarm experiment shaping-settings

Trials are data (``trials.toml``), and so is the wear (``worn.toml``). All use SARSA, 5 neurons, lambda 0, gamma 0.98
and the learning rate 0.05 (section 5.4.2); differences are taken within runs, which begin with the same weights.
"""

from pneumarm.experiments.shaping_settings.shapings import ShapingSettings

EXPERIMENT = ShapingSettings()
