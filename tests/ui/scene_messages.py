"""Messages for the scene, of round numbers, and what is asked of what is drawn."""

import numpy as np

from ros_visualise.data import (
    CameraInfo,
    Header,
    Image,
    Odometry,
    PointCloud,
    Transforms,
    TransformStamped,
)

S = 1_000_000_000
LEVEL = np.array([0.0, 0, 0, 1])
LEFT = np.array([0.0, 0, np.sqrt(0.5), np.sqrt(0.5)])
K = np.array([[100.0, 0, 79.5], [0, 100.0, 59.5], [0, 0, 1]])


def transform(parent, child, xyz, stamp_s=0.0, quat=LEVEL):
    return TransformStamped(child, np.array(xyz, float), quat, Header(int(stamp_s * S), parent))


def tf(*several):
    return Transforms(several)


def cloud(xyz, frame="lidar", stamp_s=1.0, **fields):
    names = ["x", "y", "z", *fields]
    xyz = np.asarray(xyz, np.float32)
    columns = [*xyz.T, *(np.asarray(values) for values in fields.values())]
    points = np.zeros(
        len(xyz), [(name, column.dtype) for name, column in zip(names, columns, strict=True)]
    )
    for name, column in zip(names, columns, strict=True):
        points[name] = column
    return PointCloud(points, header=Header(int(stamp_s * S), frame))


def odometry(xyz, stamp_s=1.0, frame="odom", **rest):
    header = Header(int(stamp_s * S), frame)
    return Odometry(np.array(xyz, float), LEVEL, child_frame_id="base_link", header=header, **rest)


def image(frame="camera", stamp_s=1.0, value=100, calibrated=True):
    info = CameraInfo(120, 160, K) if calibrated else None
    pixels = np.full((120, 160), value, np.uint8)
    return Image(pixels, "mono8", Header(int(stamp_s * S), frame), info)


def draw(scene, **messages):
    """Show messages on the topics of these names, and draw them."""
    for topic, message in messages.items():
        scene.show(f"/{topic}", message)
    scene.refresh()


def is_at(xyz):
    """Whether a node is there, in its parent's frame."""
    return lambda node: "position" in node and np.allclose(node["position"], xyz)


def has(name, count):
    """Whether a node has so many of something."""
    return lambda node: name in node and len(node[name]) == count
