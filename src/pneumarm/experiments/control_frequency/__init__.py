"""At which frequency should the arm be controlled?

Factor: the control frequency, 20, 30, 40 and 60 Hz. At each, transitions are collected, a simulation is fitted, an
agent is trained and moves the arm. What the thesis sets per action is kept the same per time: cut-off, discount, what
an action costs, and over how long noise is correlated; at 30 Hz these are the thesis' own.

    pneumarm experiment control-frequency --out laboratory

Answer here: the higher the frequency, the better angle and pressures are predicted a step ahead and the worse the
velocity, as in the thesis, and after a second the error of the angle is what eq. 3.7 expects. On the arm 30 Hz earned
most on average, significantly more than 40 Hz; against 20 Hz five arms leave it open. The errors of the pressures do
not grow as eq. 3.7 expects: after a second they are less than half of it.
"""

from pneumarm.experiments.control_frequency.frequencies import ControlFrequency

EXPERIMENT = ControlFrequency()
