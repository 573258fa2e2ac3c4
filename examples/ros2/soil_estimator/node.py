"""The ROS 2 node: parameters, topics and a service around `SoilLogic`.

Subscribes to `joint_states` (sensor_msgs/JointState: speed and effort of the wheel), `odom`
(nav_msgs/Odometry: speed of the rover) and `wheel_load` (geometry_msgs/WrenchStamped: force.z,
optional). Publishes `soil` (diagnostic_msgs/DiagnosticArray). The service `~/restart`
(std_srvs/Trigger) forgets all rows.
"""

from __future__ import annotations

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from soil_estimator.logic import Report, SoilLogic
from soil_estimator.rows import RowCollector
from soilml import Estimator

#: Parameters and their defaults; `context` are names and values for a file of many wheels.
PARAMETERS = {
    "model": "wheel.onnx",
    "joint": "wheel_joint",
    "wheel_radius": 0.15,
    "load": 60.0,
    "period": 1.0,
    "context_names": [""],
    "context_values": [0.0],
}


class SoilNode(Node):
    """Feeds messages to a `SoilLogic` and publishes its reports."""

    def __init__(self) -> None:
        super().__init__("soil_estimator")
        given = {name: self.declare_parameter(name, v).value for name, v in PARAMETERS.items()}
        estimator = Estimator.load(given["model"])
        if any(given["context_names"]):
            names, values = given["context_names"], given["context_values"]
            estimator = estimator.on(**dict(zip(names, values, strict=True)))
        rows = RowCollector(given["wheel_radius"], given["load"], given["period"])
        self._logic, self._joint = SoilLogic(estimator, rows), given["joint"]
        self._publisher = self.create_publisher(DiagnosticArray, "soil", 10)
        self.create_subscription(JointState, "joint_states", self._on_joints, 10)
        self.create_subscription(Odometry, "odom", self._on_odometry, 10)
        self.create_subscription(WrenchStamped, "wheel_load", self._on_load, 10)
        self.create_service(Trigger, "~/restart", self._on_restart)

    def _on_joints(self, message: JointState) -> None:
        if self._joint in message.name:
            index = list(message.name).index(self._joint)
            self._add(message, wheel_speed=message.velocity[index], torque=message.effort[index])

    def _on_odometry(self, message: Odometry) -> None:
        self._add(message, speed=message.twist.twist.linear.x)

    def _on_load(self, message: WrenchStamped) -> None:
        self._add(message, load=message.wrench.force.z)

    def _on_restart(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._logic.restart()
        response.success, response.message = True, "all rows are forgotten"
        return response

    def _add(self, message: JointState | Odometry | WrenchStamped, **samples: float) -> None:
        stamp = message.header.stamp
        report = self._logic.add(stamp.sec + 1e-9 * stamp.nanosec, **samples)
        if report is not None:
            self._publisher.publish(self._as_message(report, message))

    def _as_message(self, report: Report, source: JointState) -> DiagnosticArray:
        status = DiagnosticStatus()
        status.level = DiagnosticStatus.OK if report.sound else DiagnosticStatus.WARN
        status.name, status.message = "soil", report.message
        status.values = [KeyValue(key=k, value=f"{v:.9g}") for k, v in report.values.items()]
        array = DiagnosticArray()
        array.header.stamp, array.status = source.header.stamp, [status]
        return array


def main() -> None:
    """Run the node until it is interrupted."""
    rclpy.init()
    node = SoilNode()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
