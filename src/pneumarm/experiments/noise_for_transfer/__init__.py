"""Which noise on the simulation's predictions makes an agent that is good on the arm?

Factors: the kind of noise (white, correlated over 5 steps), whether a slow arm gets less, and how much: 1, 2 and 4
times the deviation of the fit's error; besides, no noise at all. In every run all agents begin with the same weights
and make the same movements on the arm.

    pneumarm experiment noise-for-transfer --out laboratory
"""

from pneumarm.experiments.noise_for_transfer.noises import NoiseForTransfer

EXPERIMENT = NoiseForTransfer()
