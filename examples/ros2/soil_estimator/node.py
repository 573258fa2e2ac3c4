"""The ROS 2 node: parameters, topics and a service around `SoilLogic`.

Subscribes to `joint_states` (sensor_msgs/JointState: speed and effort of the wheel), `odom`
(nav_msgs/Odometry: speed of the rover) and, where the parameter `load` says so, `wheel_load`
(geometry_msgs/WrenchStamped: force.z). Publishes `soil` after each row and `/diagnostics` once a
second (diagnostic_msgs/DiagnosticArray). The service `~/restart` (std_srvs/Trigger) forgets all
rows.
"""

from __future__ import annotations

import sys
from time import monotonic
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from soil_estimator.logic import SoilLogic, SoilReport
from soil_estimator.rows import SECOND
from soil_estimator.settings import PARAMETERS, settings_of
from soilml.errors import SoilmlError

#: Seconds between two messages of diagnostics.
DIAGNOSTICS_EVERY = 1.0
#: Largest stamp of a message, ns.
LAST_STAMP = (2**31 - 1) * SECOND


class SoilNode(Node):
    """Feeds messages to a `SoilLogic` and publishes its reports.

    Raises `SoilmlError` for a parameter that is missing or wrong, with one line that names it.
    """

    def __init__(self) -> None:
        super().__init__("soil_estimator")
        settings = settings_of({name: self._parameter(name) for name in PARAMETERS})
        self.logic = SoilLogic(settings)
        self.get_logger().info(settings.text)
        if self.logic.remark:
            self.get_logger().warning(self.logic.remark)
        self._of_joint = settings.joint
        # /diagnostics is shared: nodes of several wheels have one name, in namespaces of their own
        self._full_name = self.get_fully_qualified_name().lstrip("/")
        self._soil = self.create_publisher(DiagnosticArray, "soil", 10)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        quality = qos_profile_sensor_data
        self.create_subscription(JointState, "joint_states", self._on_joints, quality)
        self.create_subscription(Odometry, "odom", self._on_odometry, quality)
        if settings.load is None:
            self.create_subscription(WrenchStamped, "wheel_load", self._on_load, quality)
        self.create_service(Trigger, "~/restart", self._on_restart)
        self.create_timer(DIAGNOSTICS_EVERY, self._on_timer)

    def _parameter(self, name: str) -> Any:
        """The value of a parameter, None where it is not given; `settings_of` checks the types."""
        text = ParameterDescriptor(
            description=PARAMETERS[name], read_only=True, dynamic_typing=True
        )
        return self.declare_parameter(name, None, text).value

    def _on_joints(self, message: JointState) -> None:
        stamp = _nanoseconds(message.header.stamp)
        fields = message.name, message.velocity, message.effort
        self._publish(self.logic.on_joints(stamp, *fields, monotonic()))

    def _on_odometry(self, message: Odometry) -> None:
        stamp, twist = _nanoseconds(message.header.stamp), message.twist.twist
        self._publish(self.logic.on_odometry(stamp, twist.linear.x, twist.angular.z, monotonic()))

    def _on_load(self, message: WrenchStamped) -> None:
        stamp = _nanoseconds(message.header.stamp)
        self._publish(self.logic.on_load(stamp, message.wrench.force.z, monotonic()))

    def _on_restart(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.logic.restart()
        response.success, response.message = True, "all rows are forgotten"
        return response

    def _on_timer(self) -> None:
        array = DiagnosticArray()
        array.header.stamp = self.get_clock().now().to_msg()
        reports = {"inputs": self.logic.inputs(monotonic()), "soil": self.logic.soil()}
        array.status = [self._status(part, report) for part, report in reports.items()]
        self._diagnostics.publish(array)

    def _publish(self, reports: list[SoilReport]) -> None:
        for report in reports:
            array = DiagnosticArray()
            array.header.stamp.sec, array.header.stamp.nanosec = _stamp_of(report)
            array.status = [self._status("soil", report)]
            self._soil.publish(array)

    def _status(self, part: str, report: SoilReport) -> DiagnosticStatus:
        status = DiagnosticStatus()
        status.level = getattr(DiagnosticStatus, report.level.name)
        status.name, status.message = f"{self._full_name}: {part}", report.message
        status.hardware_id = self._of_joint
        status.values = [
            KeyValue(key=k, value=v if isinstance(v, str) else f"{v:.9g}")
            for k, v in report.values.items()
        ]
        return status


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * SECOND + int(stamp.nanosec)


def _stamp_of(report: SoilReport) -> tuple[int, int]:
    """Seconds and nanoseconds of a message."""
    return divmod(min(report.stamp, LAST_STAMP), SECOND)


def main() -> int:
    """Run the node until it is interrupted; 2 for a wrong parameter, 1 where rows are lost."""
    rclpy.init()
    node, status = None, 0
    try:
        node = SoilNode()
        rclpy.spin(node)
    except SoilmlError as error:
        print(f"soil_estimator: {error}", file=sys.stderr)
        return 2
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        if node is not None:
            status = _saved(node)
            node.destroy_node()
        rclpy.try_shutdown()
    return status


def _saved(node: SoilNode) -> int:
    """Keep the rows; 1 where they cannot be written."""
    try:
        node.logic.save()
    except OSError as error:
        print(f"soil_estimator: the rows are lost, state_file: {error}", file=sys.stderr)
        return 1
    return 0
