"""Which of the choices that the thesis' text leaves free bring our agents to the level of its tables?

How inputs are scaled, what an output of 1 stands for, how wide initial weights are drawn, by which rule the side of a
begin state, and how strong the noise is, on L18. In each trial all sixteen trainings of all-goals are made. The
choice is by the level of the odd ones alone (reward and success); the even ones show whether it is right.

    pneumarm experiment calibration

Not varied, because the text or its source decides them: the order of updates and the gradient in the traces are those
of Sutton and Barto; begin states are those that were recorded.
"""

from pneumarm.experiments.calibration.choices import AgentCalibration

EXPERIMENT = AgentCalibration()
