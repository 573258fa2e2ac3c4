"""A ROS 2 node: the speed of a rover without odometry, as a twist with covariance.

Subscribes to `joint_states` (sensor_msgs/JointState) and `imu` (sensor_msgs/Imu, whose orientation
gives pitch and roll). Publishes `slip_twist` (geometry_msgs/TwistWithCovarianceStamped) after each
row that has an answer, for a filter such as robot_localization, and `slip_flags`
(diagnostic_msgs/DiagnosticArray) after every row. The service `~/restart` (std_srvs/Trigger)
forgets all rows.
"""

from __future__ import annotations

import sys
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import TwistWithCovarianceStamped
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Imu, JointState
from std_srvs.srv import Trigger

from soil_estimator.rows import SECOND
from soil_estimator.slip_logic import PARAMETERS, SlipLogic, Twist
from soilml.errors import SoilmlError


class SlipNode(Node):
    """Feeds messages to a `SlipLogic` and publishes its twists."""

    def __init__(self) -> None:
        super().__init__("slip_speed")
        self.logic = SlipLogic({name: self._parameter(name) for name in PARAMETERS})
        self._twist = self.create_publisher(TwistWithCovarianceStamped, "slip_twist", 10)
        self._flags = self.create_publisher(DiagnosticArray, "slip_flags", 10)
        quality = qos_profile_sensor_data
        self.create_subscription(JointState, "joint_states", self._on_joints, quality)
        self.create_subscription(Imu, "imu", self._on_imu, quality)
        self.create_service(Trigger, "~/restart", self._on_restart)

    def _parameter(self, name: str) -> Any:
        text = ParameterDescriptor(
            description=PARAMETERS[name], read_only=True, dynamic_typing=True
        )
        return self.declare_parameter(name, None, text).value

    def _on_joints(self, message: JointState) -> None:
        fields = message.name, message.velocity, message.effort
        self._publish(self.logic.on_joints(_nanoseconds(message.header.stamp), *fields))

    def _on_imu(self, message: Imu) -> None:
        q = message.orientation
        stamp = _nanoseconds(message.header.stamp)
        self._publish(self.logic.on_attitude(stamp, q.x, q.y, q.z, q.w))

    def _on_restart(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.logic.restart()
        response.success, response.message = True, "all rows are forgotten"
        return response

    def _publish(self, twists: list[Twist]) -> None:
        for twist in twists:
            seconds = divmod(twist.stamp, SECOND)
            array, status = DiagnosticArray(), DiagnosticStatus()
            array.header.stamp.sec, array.header.stamp.nanosec = seconds
            answered = twist.speed is not None
            status.level = DiagnosticStatus.WARN if twist.flags else DiagnosticStatus.OK
            status.name = f"{self.get_name()}: slip"
            status.message = ", ".join(twist.flags) or "determined"
            status.values = [KeyValue(key="answered", value=str(answered))]
            array.status = [status]
            self._flags.publish(array)
            if answered:
                message = TwistWithCovarianceStamped()
                message.header.stamp.sec, message.header.stamp.nanosec = seconds
                message.header.frame_id = self.logic.frame
                message.twist.twist.linear.x = twist.speed
                message.twist.covariance = twist.covariance
                self._twist.publish(message)


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * SECOND + int(stamp.nanosec)


def main() -> int:
    """Run the node until it is interrupted; 2 for a wrong parameter."""
    rclpy.init()
    node = None
    try:
        node = SlipNode()
        rclpy.spin(node)
    except SoilmlError as error:
        print(f"slip_speed: {error}", file=sys.stderr)
        return 2
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0
