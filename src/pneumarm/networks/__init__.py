"""Tiny networks, fitted by Levenberg-Marquardt or by gradient descent, or a linear model by least squares."""

from pneumarm.networks.gradient_descent import gradient_descent, two_layers
from pneumarm.networks.initial import nguyen_widrow
from pneumarm.networks.least_squares import Importance, importance, least_squares, nested_least_squares
from pneumarm.networks.levenberg_marquardt import Fit, LevenbergMarquardt, levenberg_marquardt
from pneumarm.networks.network import Network

__all__ = [
    "Fit",
    "Importance",
    "LevenbergMarquardt",
    "Network",
    "gradient_descent",
    "importance",
    "least_squares",
    "levenberg_marquardt",
    "nested_least_squares",
    "nguyen_widrow",
    "two_layers",
]
