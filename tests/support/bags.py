"""Bags of a robot whose speed follows its command, in each format that is read."""

import io
import json

import numpy as np

RULE = "=" * 80
TWIST = "Vector3 linear\nVector3 angular\n"
VECTOR = "float64 x\nfloat64 y\nfloat64 z\n"
TWIST_TEXT = f"{TWIST}{RULE}\nMSG: geometry_msgs/Vector3\n{VECTOR}"
STATE_TEXT = (
    "std_msgs/Header header\nfloat64 speed\nfloat64[3] place\nfloat32[] scan\nstring name\n"
    f"{RULE}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
)

#: When the bag begins, ns since 1970; period of commands and of states; age of a state when it is
#: received; delay and lag of the robot, all in s.
FIRST = 1_700_000_000_000_000_000
PERIOD, ROW, AGE, DELAY, LAG = 0.05, 0.02, 0.03, 0.15, 0.08


def ns(seconds):
    return FIRST + round(seconds * 1e9)


def truth(seconds=20.0, seed=2):
    """Times and commands; times of states when they are measured, and the speed then."""
    draw = np.random.default_rng(seed)
    sent = np.arange(0.0, seconds, PERIOD)
    command = np.repeat(draw.choice([-0.5, 0.0, 0.5, 1.0], sent.size // 12 + 1), 12)[: sent.size]
    step = 0.005
    grid = np.arange(0.0, seconds, step)
    asked = np.where(
        grid < DELAY, 0.0, command[np.maximum(np.searchsorted(sent, grid - DELAY + 1e-9) - 1, 0)]
    )
    speed = np.zeros(grid.size)
    for k in range(1, grid.size):
        speed[k] = asked[k - 1] + (speed[k - 1] - asked[k - 1]) * np.exp(-step / LAG)
    rows = np.arange(ROW, seconds - AGE, ROW)
    measured = np.interp(rows, grid, speed) + 0.005 * draw.standard_normal(rows.size)
    return sent, command, rows, measured


def events(**options):
    """Topic, time of reception, and contents, in the order of reception."""
    sent, command, rows, measured = truth(**options)
    pairs = zip(sent, command, strict=True)
    found = [(at, "/cmd_vel", {"linear": {"x": float(value)}}) for at, value in pairs]
    for at, speed in zip(rows, measured, strict=True):
        found.append((at + AGE, "/state", {"stamp": float(at), "speed": float(speed)}))
    return sorted(found, key=lambda one: one[0])


def _stamp(seconds):
    whole = ns(seconds)
    return {"sec": whole // 10**9, "nanosec": whole % 10**9}


def mcap(compression="zstd", chunk_size=1 << 20, **options):
    """An MCAP file of ROS 2."""
    from mcap.writer import CompressionType
    from mcap_ros2.writer import Writer

    stream = io.BytesIO()
    log = Writer(stream, chunk_size, CompressionType[compression.upper()])
    twist = log.register_msgdef("geometry_msgs/msg/Twist", TWIST_TEXT)
    state = log.register_msgdef("robot/msg/State", STATE_TEXT)
    zero = {"x": 0.0, "y": 0.0, "z": 0.0}
    for at, topic, told in events(**options):
        if topic == "/cmd_vel":
            schema, message = twist, {"linear": {**zero, **told["linear"]}, "angular": zero}
        else:
            header = {"stamp": _stamp(told["stamp"]), "frame_id": "map"}
            message = {"header": header, "speed": told["speed"], "place": [1.0, 2.0, 3.0]}
            schema, message = state, message | {"scan": [0.5] * 50, "name": "r"}
        log.write_message(topic, schema, message, log_time=ns(at), publish_time=ns(at))
    log.finish()
    return stream.getvalue()


def mcap_json(header=False, **options):
    """An MCAP file of JSON, in which the command may have a time in a header too."""
    from mcap.writer import Writer

    stream = io.BytesIO()
    log = Writer(stream)
    log.start()
    numbers = {
        name: log.register_channel(name, "json", schema_id=0) for name in ("/cmd_vel", "/state")
    }
    for at, topic, told in events(**options):
        row = dict(told)
        if topic == "/state":
            row["header"] = {"stamp": _stamp(row.pop("stamp"))}
        elif header:
            row["header"] = {"stamp": _stamp(at + header - 1.0)}
        log.add_message(numbers[topic], ns(at), json.dumps(row).encode(), ns(at))
    log.finish()
    return stream.getvalue()


def _ros_messages(store, **options):
    """Messages of ROS types with the same contents."""
    types = store.types
    twist, vector = types["geometry_msgs/msg/Twist"], types["geometry_msgs/msg/Vector3"]
    stamped = types["geometry_msgs/msg/Vector3Stamped"]
    header, time = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
    more = {"seq": 0} if "seq" in header.__dataclass_fields__ else {}
    zero = vector(x=0.0, y=0.0, z=0.0)
    for at, topic, told in events(**options):
        if topic == "/cmd_vel":
            message = twist(linear=vector(x=told["linear"]["x"], y=0.0, z=0.0), angular=zero)
            yield at, topic, "geometry_msgs/msg/Twist", message
        else:
            stamp = header(stamp=time(**_stamp(told["stamp"])), frame_id="map", **more)
            message = stamped(header=stamp, vector=vector(x=told["speed"], y=0.0, z=0.0))
            yield at, topic, "geometry_msgs/msg/Vector3Stamped", message


def ros1(path, **options):
    """Write a bag of ROS 1."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(path) as bag:
        topics = {}
        for at, topic, kind, message in _ros_messages(store, **options):
            if topic not in topics:
                topics[topic] = bag.add_connection(topic, kind, typestore=store)
            bag.write(topics[topic], ns(at), store.serialize_ros1(message, kind))


def ros2(path, **options):
    """Write the folder of a bag of ROS 2."""
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(path, version=9) as bag:
        topics = {}
        for at, topic, kind, message in _ros_messages(store, **options):
            if topic not in topics:
                topics[topic] = bag.add_connection(topic, kind, typestore=store)
            bag.write(topics[topic], ns(at), store.serialize_cdr(message, kind))
