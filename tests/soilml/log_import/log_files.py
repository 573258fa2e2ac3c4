"""One drive as a log of each format that is read."""

import json
from types import SimpleNamespace

import numpy as np
from simulated_rig import RADIUS


def columns_of(drive):
    """Wheel speed (rad/s), travel (m/s), torque (N m) and load (N) over time (s)."""
    return {
        "time": drive.time,
        "wheel_speed": drive.rim / RADIUS,
        "ground_speed": drive.ground,
        "torque": drive.torque,
        "load": drive.load,
    }


def write_parquet(path, drive):
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = columns_of(drive)
    stamps = (1.7e18 + 1e9 * columns.pop("time")).astype("int64")
    table = pa.table({"time": pa.array(stamps, pa.timestamp("ns")), **columns})
    pq.write_table(table, path)
    return path


def write_matlab(path, drive):
    from scipy.io import savemat

    columns = columns_of(drive)
    savemat(path, {"log": {"rig": {k: v[:, None] for k, v in columns.items()}}, "radius": RADIUS})
    return path


def write_matlab_73(path, drive):
    import h5py

    with h5py.File(path, "w", userblock_size=512) as opened:
        for name, values in columns_of(drive).items():
            opened.create_dataset(f"log/{name}", data=values[None, :])
    with path.open("r+b") as opened:
        opened.write(b"MATLAB 7.3 MAT-file".ljust(128))
    return path


def write_mcap_json(path, drive):
    from mcap.writer import Writer

    with path.open("wb") as opened:
        writer = Writer(opened)
        writer.start()
        schema = writer.register_schema("rig", "jsonschema", b"{}")
        topics = {
            name: writer.register_channel(f"/{name}", "json", schema)
            for name in ("drive", "carriage", "force")
        }
        for i, t in enumerate(drive.time):
            stamp = int(1e9 * (1.7e9 + t))
            rows = {
                "drive": {"wheel_speed": drive.rim[i] / RADIUS, "torque": drive.torque[i]},
                "carriage": {"ground_speed": drive.ground[i]},
                "force": {"wrench": {"force": {"z": drive.load[i]}}},
            }
            for name, row in rows.items():
                data = json.dumps(row).encode()
                writer.add_message(topics[name], stamp, data, stamp)
        writer.finish()
    return path


def write_mcap_protobuf(path, drive):
    """One topic with a time of its own, a nested message and an array; zeros are left out by
    protobuf, so that the wheel at rest is written as nothing."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2
    from mcap_protobuf.writer import Writer

    kinds = {"f": descriptor_pb2.FieldDescriptorProto.TYPE_DOUBLE,
             "m": descriptor_pb2.FieldDescriptorProto.TYPE_MESSAGE}  # fmt: skip
    file = descriptor_pb2.FileDescriptorProto(name="rig.proto", package="rig", syntax="proto3")
    file.dependency.append("google/protobuf/timestamp.proto")
    for name, fields in {
        "Force": [("z", "f", "")],
        "State": [("stamp", "m", ".google.protobuf.Timestamp"), ("wheel_speed", "f", ""),
                  ("ground_speed", "f", ""), ("torque", "f", ""), ("force", "m", ".rig.Force"),
                  ("temperatures", "f", "")],
    }.items():  # fmt: skip
        message = file.message_type.add(name=name)
        for number, (field, kind, type_name) in enumerate(fields, 1):
            added = message.field.add(name=field, number=number, type=kinds[kind], label=1)
            if type_name:
                added.type_name = type_name
            if field == "temperatures":
                added.label = 3
    pool = descriptor_pool.DescriptorPool()
    pool.AddSerializedFile(timestamp_pb2.DESCRIPTOR.serialized_pb)
    pool.Add(file)
    state = message_factory.GetMessageClass(pool.FindMessageTypeByName("rig.State"))
    with path.open("wb") as opened, Writer(opened) as writer:
        for i, t in enumerate(drive.time):
            message = state(wheel_speed=drive.rim[i] / RADIUS, ground_speed=drive.ground[i],
                            torque=drive.torque[i], temperatures=[20.0, 21.0])  # fmt: skip
            message.force.z = drive.load[i]
            message.stamp.seconds, message.stamp.nanos = int(1.7e9 + t), int(1e9 * (t % 1.0))
            # the logger writes late and unevenly; the stamp is when the sensors were read
            late = int(1e9 * (1.7e9 + t + 0.05 * (i % 7)))
            writer.write_message("/rig", message, log_time=late, publish_time=late)
    return path


def write_bag(path, drive, version):
    """Joint states, odometry and a wrench, as ROS 1 or ROS 2 writes them; load at half the rate."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
    types = store.types
    stamp_of, header_of = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
    vector, point = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Point"]
    kinds = {
        "/joint_states": "sensor_msgs/msg/JointState",
        "/odom": "nav_msgs/msg/Odometry",
        "/ft_sensor": "geometry_msgs/msg/WrenchStamped",
    }
    writer = Writer1(path) if version == 1 else Writer2(path, version=9)
    serialize = store.serialize_ros1 if version == 1 else store.serialize_cdr
    with writer:
        connections = {
            topic: writer.add_connection(topic, kind, typestore=store)
            for topic, kind in kinds.items()
        }
        for i, t in enumerate(drive.time):
            nanoseconds = int(1e9 * (1.7e9 + t))
            stamp = stamp_of(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
            more = {"seq": i} if version == 1 else {}
            header = header_of(stamp=stamp, frame_id="", **more)
            zero = vector(x=0.0, y=0.0, z=0.0)
            messages = {
                "/joint_states": types[kinds["/joint_states"]](
                    header=header,
                    name=["wheel_joint"],
                    position=np.array([0.0]),
                    velocity=np.array([drive.rim[i] / RADIUS]),
                    effort=np.array([drive.torque[i]]),
                ),
                "/odom": types[kinds["/odom"]](
                    header=header,
                    child_frame_id="",
                    pose=types["geometry_msgs/msg/PoseWithCovariance"](
                        pose=types["geometry_msgs/msg/Pose"](
                            position=point(x=0.0, y=0.0, z=0.0),
                            orientation=types["geometry_msgs/msg/Quaternion"](
                                x=0.0, y=0.0, z=0.0, w=1.0
                            ),
                        ),
                        covariance=np.zeros(36),
                    ),
                    twist=types["geometry_msgs/msg/TwistWithCovariance"](
                        twist=types["geometry_msgs/msg/Twist"](
                            linear=vector(x=drive.ground[i], y=0.0, z=0.0), angular=zero
                        ),
                        covariance=np.zeros(36),
                    ),
                ),
            }
            if i % 2 == 0:
                messages["/ft_sensor"] = types[kinds["/ft_sensor"]](
                    header=header,
                    wrench=types["geometry_msgs/msg/Wrench"](
                        force=vector(x=0.0, y=0.0, z=drive.load[i]), torque=zero
                    ),
                )
            for topic, message in messages.items():
                raw = serialize(message, kinds[topic])
                writer.write(connections[topic], nanoseconds, raw)
    return path


FORMATS = SimpleNamespace(
    parquet=(".parquet", write_parquet),
    matlab=(".mat", write_matlab),
    matlab_73=(".mat", write_matlab_73),
    mcap=(".mcap", write_mcap_json),
    mcap_protobuf=(".mcap", write_mcap_protobuf),
    ros1=(".bag", lambda path, drive: write_bag(path, drive, 1)),
    ros2=("", lambda path, drive: write_bag(path, drive, 2)),
)
