"""Recordings of a robot's flight over tags of which all is known, as a detector records them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from made_worlds import SIZE, corners_seen, drifting, flight, floor, turn
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from ros_visualise.estimation.mapping.unknowns import MeasurementNoise
from ros_visualise.geometry import rotations
from ros_visualise.geometry.se3 import from_parts, inverse

FOUND = "apriltag_msgs/msg/ApriltagArrayStamped"
TAG, FRAMES = "apriltag_msgs/msg/Apriltag", "tf2_msgs/msg/TFMessage"
TEXTS = {
    TAG: "int32 id\nstring family\nint32 hamming\nint32 border\nint32 bits\n"
    "geometry_msgs/Point center\ngeometry_msgs/Point[4] corners",
    FOUND: "std_msgs/Header header\nApriltag[] apriltags",
    FRAMES: "geometry_msgs/TransformStamped[] transforms",
}
CALIBRATION = """\
image_width: 640
image_height: 480
distortion_model: plumb_bob
camera_matrix: {rows: 3, cols: 3, data: [600, 0, 320, 0, 600, 240, 0, 0, 1]}
distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
projection_matrix: {rows: 3, cols: 4, data: [600, 0, 320, 0, 0, 600, 240, 0, 0, 0, 1, 0]}
"""
"""Of the camera of `made_worlds`."""
MOUNTED = from_parts(turn([0, 0, 0.3]) @ np.diag([1.0, -1, -1]), [0.1, 0.0, -0.05])
"""T_base_camera."""
FIRST_NS, PERIOD_NS = 1_000_000_000_000, 100_000_000


class Flight:
    """Views of tags, what the odometry tells of them, and what goes wrong.

    Attributes:
        T_map_tag: (M, 4, 4), numbered in order.
        T_map_camera: (N, 4, 4).
        stamps_ns: (N,) of the images.
        off: by which the camera is turned from what the frames tell, degrees about its axes.
        place_of: (tag, view) -> the places where it is seen.
        size_of: tag -> its side, which is SIZE for whoever reads the recording.
        seen_at: view -> the view whose picture the camera shows.
    """

    def __init__(self, seed: int = 2, views: int = 40, tags: int = 7, width: float = 4.0) -> None:
        random = self._random = np.random.default_rng(seed)
        self.T_map_tag = floor(random, tags, width)
        self.T_map_camera = flight(random, views, width)
        noise = MeasurementNoise(way_m=0.005, tilt_rad=5e-4, heading_rad=1e-3)
        self.T_told_camera = drifting(random, self.T_map_camera, noise)
        self.stamps_ns = FIRST_NS + PERIOD_NS * np.arange(views)
        self.off = np.zeros(3)
        self.place_of: Callable[[int, int], list] = lambda tag, view: [self.T_map_tag[tag]]
        self.size_of: Callable[[int], float] = lambda tag: SIZE
        self.seen_at: Callable[[int], int] = lambda view: view

    def write(self, path: Path) -> Path:
        """As a bag of /tags, /tf and /tf_static."""
        store = get_typestore(Stores.ROS1_NOETIC)
        for name, text in TEXTS.items():
            store.register(get_types_from_msg(text, name))
        self._of = {
            name.rpartition("/")[2]: kind
            for name, kind in store.types.items()
            if name != "std_msgs/msg/Time"
        }
        kinds = {"/tags": FOUND, "/tf": FRAMES, "/tf_static": FRAMES}
        with Writer(path) as bag:
            topics = {
                topic: bag.add_connection(topic, kind, typestore=store)
                for topic, kind in kinds.items()
            }

            def put(topic, stamp_ns, message):
                data = store.serialize_ros1(message, kinds[topic])
                bag.write(topics[topic], int(stamp_ns), data)

            told = inverse(MOUNTED @ from_parts(turn(np.deg2rad(self.off)), np.zeros(3)))
            static = self._frame(0, "base_link", "camera", MOUNTED)
            put("/tf_static", self.stamps_ns[0], static)
            for view, stamp_ns in enumerate(self.stamps_ns):
                base = self.T_told_camera[view] @ told
                put("/tf", stamp_ns, self._frame(stamp_ns, "map", "base_link", base))
                put("/tags", stamp_ns, self._found(view, stamp_ns))
        return path

    def _found(self, view, stamp_ns):
        tags = []
        for tag in range(len(self.T_map_tag)):
            for place in self.place_of(tag, view):
                camera = self.T_map_camera[self.seen_at(view)]
                corners = corners_seen(camera, place, self.size_of(tag))
                if corners is None:
                    continue
                noise = np.random.default_rng((self.seen_at(view), tag)).standard_normal((4, 2))
                corners = corners + 0.1 * noise
                point = self._of["Point"]
                center = point(*corners.mean(axis=0), 0.0)
                several = [point(u, v, 0.0) for u, v in corners]
                tags.append(self._of["Apriltag"](tag, "tf36h11", 0, 1, 6, center, several))
        return self._of["ApriltagArrayStamped"](self._header(stamp_ns, "camera"), tags)

    def _frame(self, stamp_ns, parent, child, T):
        place = self._of["Vector3"](*T[:3, 3])
        turned = self._of["Quaternion"](*rotations.from_matrix(T[:3, :3]))
        header = self._header(stamp_ns, parent)
        moved = self._of["TransformStamped"](header, child, self._of["Transform"](place, turned))
        return self._of["TFMessage"]([moved])

    def _header(self, stamp_ns, frame_id):
        seconds, rest = divmod(int(stamp_ns), 10**9)
        return self._of["Header"](0, self._of["Time"](seconds, rest), frame_id)
