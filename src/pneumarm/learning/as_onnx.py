"""An agent as ONNX, whichever of the kinds that can be is at hand."""

from pneumarm.errors import UnusableInput
from pneumarm.learning.network_agent import NetworkAgent
from pneumarm.learning.policy.agent import PolicyAgent
from pneumarm.learning.policy.as_onnx import policy_as_onnx
from pneumarm.learning.servo.agent import ServoAgent
from pneumarm.learning.servo.as_onnx import servo_as_onnx


def as_onnx(agent: NetworkAgent) -> bytes:
    """Return ``agent`` as the content of a file; its documentation says what goes in and what comes out.

    Raises:
        UnusableInput: it is of another kind than servo and policy, or the library that writes it is not installed.

    """
    if isinstance(agent, ServoAgent):
        return servo_as_onnx(agent)
    if isinstance(agent, PolicyAgent):
        return policy_as_onnx(agent)
    raise UnusableInput(f"{type(agent).__name__}: only agents of the methods servo and policy are exported as ONNX")
