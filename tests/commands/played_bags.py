"""Small ROS 1 bags of any messages, and what a command that plays one answers."""

import numpy as np
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

ROS1 = get_typestore(Stores.ROS1_NOETIC)
T = ROS1.types
START_NS = 1_600_000_000_000_000_000
STEP_NS = 100_000_000
QUICK = ["--view", "none", "--rate", "0"]


def header(stamp_ns, frame_id="camera"):
    time = T["builtin_interfaces/msg/Time"](*divmod(stamp_ns, 10**9))
    return T["std_msgs/msg/Header"](0, time, frame_id)


def image(stamp_ns, encoding="mono8", width=8, height=6, pixel=1, **changed):
    """A ``sensor_msgs/msg/Image`` of ``pixel`` bytes a pixel, all of them 100."""
    fields = {
        "header": header(stamp_ns),
        "height": height,
        "width": width,
        "encoding": encoding,
        "is_bigendian": 0,
        "step": width * pixel,
        "data": np.full(height * width * pixel, 100, np.uint8),
    }
    return T["sensor_msgs/msg/Image"](**(fields | changed))


def write_bag(path, **topics):
    """A bag with these topics: name -> (type, {stamp_ns: message or its bytes})."""
    with Writer(path) as bag:
        for name, (kind, messages) in topics.items():
            connection = bag.add_connection(f"/{name}", kind, typestore=ROS1)
            for stamp_ns, message in messages.items():
                if not isinstance(message, bytes):
                    message = bytes(ROS1.serialize_ros1(message, kind))
                bag.write(connection, stamp_ns, message)
    return path


def images(make=image, count=5, start_ns=START_NS, step_ns=STEP_NS):
    """A topic of images for `write_bag`."""
    stamps_ns = [start_ns + step_ns * number for number in range(count)]
    return "sensor_msgs/msg/Image", {stamp_ns: make(stamp_ns) for stamp_ns in stamps_ns}
