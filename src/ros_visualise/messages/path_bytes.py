"""Fast encoding of paths: one of thousands of poses is written several times a second.

Sources: ROS 1's serialization, which packs fields; OMG DDS-XTypes, section 7.4, plain CDR, which
puts each at a multiple of its own size, counted from behind the four bytes in front of a message.
"""

from __future__ import annotations

import numpy as np

from ros_visualise.data import Path
from ros_visualise.data.fields import check_times
from ros_visualise.messages.definitions import Encoding

_NS = 1_000_000_000
_DOUBLE = 8


def pose_bytes(path: Path, encoding: Encoding, start: int) -> bytes:
    """The bytes of the poses in a nav_msgs/msg/Path.

    Args:
        path: the path.
        encoding: encoding of ROS 1 or ROS 2.
        start: offset of the first pose in the message, without CDR's header of four bytes.

    Raises:
        ValueError: ROS cannot store one of its stamps.
    """
    check_times(path.stamps_ns)
    seconds, nanoseconds = np.divmod(path.stamps_ns, _NS)
    poses = np.zeros(len(path.stamps_ns), _layout(path.header.frame_id, encoding))
    poses["sec"], poses["nanosec"] = seconds, nanoseconds
    frame = path.header.frame_id.encode()
    poses["size"] = len(frame) + (encoding == "cdr")
    if frame:
        poses["frame_id"] = frame
    poses["pose"][:, :3], poses["pose"][:, 3:] = path.positions_xyz, path.quats_xyzw
    written = poses.tobytes()
    if encoding == "ros1" or start % _DOUBLE == 0 or not written:
        return written
    before = len(_start_of(frame))  # the first begins elsewhere between two doubles than others
    doubles = poses.dtype.fields["pose"][1]  # type: ignore[index]
    return written[:before] + bytes(-(start + before) % _DOUBLE) + written[doubles:]


def _start_of(frame: bytes) -> bytes:
    """Room for a stamp, and the frame with its length and its end, in CDR."""
    return bytes(3 * 4) + frame + b"\0"


def _layout(frame_id: str, encoding: Encoding) -> np.dtype[np.void]:
    frame = frame_id.encode()
    fields = [("sec", "<u4"), ("nanosec", "<u4"), ("size", "<u4")]
    if encoding == "ros1":
        fields.insert(0, ("seq", "<u4"))
    if frame:
        fields.append(("frame_id", f"S{len(frame)}"))
    if encoding == "cdr":
        used = len(_start_of(frame))
        fields.append(("end", f"V{1 + -used % _DOUBLE}"))
    return np.dtype([*fields, ("pose", "<f8", (7,))])
