"""A node of ROS 2: it tells where the arm is (JointState) and moves it to goals that come as radians.

Needs arm.agent of first.py, and a sourced ROS 2 (rclpy, sensor_msgs, std_msgs, std_srvs)::

    python ros2_node.py virtual:seed=7
    ros2 topic echo /joint_states
    ros2 topic pub --once /goal std_msgs/msg/Float64MultiArray "{data: [0.3]}"
    ros2 service call /stop std_srvs/srv/Trigger

All that is not ROS is in :class:`Bridge`, which needs none and is tested without.
"""

import sys
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

import pneumarm
from pneumarm.arm import Arm, guarded
from pneumarm.arm.reference import Reference
from pneumarm.control.loaded import LoadedTracker
from pneumarm.errors import UnusableInput
from pneumarm.live.pace import in_real_time


class State(NamedTuple):
    """What a JointState holds; 0 rad is the middle of the range."""

    name: list[str]
    position: list[float]
    """[rad]"""
    velocity: list[float]
    """[rad/s]"""
    pressure: list[float]
    """Of all muscles [bar]."""


class Bridge:
    """Moves an arm turn by turn; a context manager that closes it. A goal is held until the next, or a stop."""

    def __init__(self, arm: Arm, controller: LoadedTracker) -> None:
        self.arm, self._controller = guarded(arm), controller
        self._goal: NDArray[np.float64] | None = None
        self._before: tuple[float, NDArray[np.float64]] | None = None

    def __enter__(self) -> "Bridge":
        return self

    def __exit__(self, *_: object) -> None:
        self.arm.close()

    def go(self, radians: ArrayLike) -> None:
        """Move to angles, one a joint [rad].

        Raises:
            UnusableInput: they are not as many as joints, no numbers, or beyond what the arm has been seen to reach.

        """
        degrees = np.degrees(np.asarray(radians, float))
        self._controller.reset(goal_deg=degrees)  # which checks it
        spec = self.arm.spec
        goal = sum(spec.angle_range) / 2 + degrees.reshape(spec.joints) * spec.counts_per_degree
        self._controller.track(Reference(lambda time: goal))
        self._goal = goal

    def stop(self) -> None:
        """Let the air out, from the next turn on until there is another goal."""
        self._goal = None

    def turn(self) -> State:
        """Read, decide, and let a control period pass."""
        reading = self.arm.read()
        if self._goal is None:
            self.arm.decide(np.full((self.arm.spec.joints, 2), -1, np.int8))
        else:
            self.arm.decide(self._controller.act(reading))
        angle = np.radians(self.arm.spec.degrees(reading.angle))
        time, before = self._before or (reading.time - self.arm.spec.period, angle)
        self._before = (reading.time, angle)
        velocity = (angle - before) / (reading.time - time)
        self.arm.wait(self.arm.spec.period)
        names = [f"joint_{number + 1}" for number in range(len(angle))]
        pressure = self.arm.spec.bar(reading.pressure).ravel()
        return State(names, angle.tolist(), velocity.tolist(), pressure.tolist())


def main(arm: str) -> None:
    """Serve ``arm`` until the node is shut down."""
    try:
        import rclpy
        from sensor_msgs.msg import JointState
        from std_msgs.msg import Float64MultiArray
        from std_srvs.srv import Trigger
    except ImportError as error:
        sys.exit(f"{error}: install ROS 2, and source its setup.bash in this shell")

    controller = pneumarm.load_controller("arm.agent")
    assert isinstance(controller, LoadedTracker)
    rclpy.init()
    node = rclpy.create_node("pneumarm")
    states = node.create_publisher(JointState, "joint_states", 10)
    with Bridge(in_real_time(pneumarm.open_arm(arm)), controller) as bridge:

        def go(message: Float64MultiArray) -> None:
            try:
                bridge.go(message.data)
            except UnusableInput as error:
                node.get_logger().warning(str(error))

        def stop(_: Trigger.Request, answer: Trigger.Response) -> Trigger.Response:
            bridge.stop()
            answer.success = True
            return answer

        node.create_subscription(Float64MultiArray, "goal", go, 10)
        node.create_service(Trigger, "stop", stop)
        while rclpy.ok():
            state = bridge.turn()
            message = JointState(name=state.name, position=state.position, velocity=state.velocity)
            message.header.stamp = node.get_clock().now().to_msg()
            states.publish(message)
            rclpy.spin_once(node, timeout_sec=0)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "virtual:seed=7")
