"""Fine tuning (section 5.3): does another experiment, its levels closer together, find better settings?

The thesis' trial 10 beats its derived settings, "mainly" because two levels far apart were used (section 5.4.2); for
fine tuning it advises more levels that lie closer together (section 5.3). That is done here: learning rate, neurons,
traces and discount factor at three levels each on L9, with SARSA; trial 10 of all-goals is repeated beside it.

    pneumarm experiment fine-tuning

The best of nine trials looks better than it is. So the settings are chosen by the odd runs and compared with trial
10 on the even ones, which had no part in the choice.
"""

from pneumarm.experiments.fine_tuning.levels import FineTuning

EXPERIMENT = FineTuning()
