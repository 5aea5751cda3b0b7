"""At which frequency should the arm be controlled?

Factor: the control frequency, 20, 30, 40 and 60 Hz. At each, transitions are collected, a simulation is fitted, an
agent is trained and moves the arm. What the thesis sets per action is kept the same per time: cut-off, discount, what
an action costs, and over how long noise is correlated; at 30 Hz these are the thesis' own.

    pneumarm experiment control-frequency --out laboratory
"""

from pneumarm.experiments.control_frequency.frequencies import ControlFrequency

EXPERIMENT = ControlFrequency()
