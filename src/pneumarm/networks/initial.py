"""Initial weights by Nguyen and Widrow."""

import numpy as np

from pneumarm.networks.network import Network


def nguyen_widrow(inputs: int, hidden: int, outputs: int, seed: int) -> Network:
    """Return a network whose hidden units share out inputs within [-1, 1] among themselves.

    Each hidden unit gets a random direction of the length 0.7 hidden^(1/inputs) and a bias that puts the middle
    of its slope at a random place along it; output weights are small.

    Source: D. Nguyen and B. Widrow, Improving the learning speed of 2-layer neural networks by choosing initial
    values of the adaptive weights, IJCNN 1990 (also the initialisation of the thesis' toolbox).
    """
    generator = np.random.default_rng(seed)
    length = 0.7 * hidden ** (1 / inputs)
    direction = generator.uniform(-1, 1, (inputs, hidden))
    direction *= length / np.linalg.norm(direction, axis=0)
    bias = length * generator.permutation(np.linspace(-1, 1, hidden)) if hidden > 1 else np.zeros(1)
    return Network(direction, bias, generator.uniform(-0.1, 0.1, (hidden, outputs)), np.zeros(outputs))
