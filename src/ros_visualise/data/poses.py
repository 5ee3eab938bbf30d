"""Where something is, and how it moves."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from ros_visualise.data.header import Floats, Header, keep


@dataclass(frozen=True, eq=False)
class PoseStamped:
    """Where something is in the frame of its header: position (3,) in metres, quaternion (4,)."""

    position_xyz: Floats
    quat_xyzw: Floats
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(self, position_xyz=(3,), quat_xyzw=(4,))


@dataclass(frozen=True, eq=False)
class Odometry:
    """A pose in the frame of its header, and velocities in the frame ``child_frame_id``.

    ``position_xyz`` (3,) in metres and ``quat_xyzw`` (4,); ``linear_xyz`` (3,) in m/s and
    ``angular_xyz`` (3,) in rad/s; covariances 6x6 in the order x, y, z, and rotations about them.
    """

    position_xyz: Floats
    quat_xyzw: Floats
    linear_xyz: Floats = field(default_factory=lambda: np.zeros(3))
    angular_xyz: Floats = field(default_factory=lambda: np.zeros(3))
    pose_covariance: Floats = field(default_factory=lambda: np.zeros((6, 6)))
    twist_covariance: Floats = field(default_factory=lambda: np.zeros((6, 6)))
    child_frame_id: str = ""
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(self, position_xyz=(3,), quat_xyzw=(4,), linear_xyz=(3,), angular_xyz=(3,))
        keep(self, pose_covariance=(6, 6), twist_covariance=(6, 6))


@dataclass(frozen=True, eq=False)
class Path:
    """Poses in the frame of its header, in the order in which they were passed.

    ``stamps_ns`` (N,), ``positions_xyz`` (N, 3) in metres, ``quats_xyzw`` (N, 4).
    """

    stamps_ns: npt.NDArray[np.int64]
    positions_xyz: Floats
    quats_xyzw: Floats
    header: Header = Header()

    def __post_init__(self) -> None:
        count = len(self.stamps_ns)
        keep(self, np.int64, stamps_ns=(count,))
        keep(self, positions_xyz=(count, 3), quats_xyzw=(count, 4))

    @property
    def nbytes(self) -> int:
        """Bytes of its poses."""
        return self.stamps_ns.nbytes + self.positions_xyz.nbytes + self.quats_xyzw.nbytes


@dataclass(frozen=True, eq=False)
class PoseArray:
    """Poses in the frame of its header, in no order: where something may be.

    ``positions_xyz`` (N, 3) in metres, ``quats_xyzw`` (N, 4).
    """

    positions_xyz: Floats
    quats_xyzw: Floats
    header: Header = Header()

    def __post_init__(self) -> None:
        count = len(self.positions_xyz)
        keep(self, positions_xyz=(count, 3), quats_xyzw=(count, 4))

    @property
    def nbytes(self) -> int:
        """Bytes of its poses."""
        return self.positions_xyz.nbytes + self.quats_xyzw.nbytes


@dataclass(frozen=True, eq=False)
class PoseWithCovarianceStamped:
    """A `PoseStamped` and how sure it is: covariance 6x6 in the order x, y, z, rotations."""

    position_xyz: Floats
    quat_xyzw: Floats
    covariance: Floats = field(default_factory=lambda: np.zeros((6, 6)))
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(self, position_xyz=(3,), quat_xyzw=(4,), covariance=(6, 6))


@dataclass(frozen=True, eq=False)
class TwistStamped:
    """Velocities in the frame of the header: (3,) in m/s and (3,) in rad/s."""

    linear_xyz: Floats
    angular_xyz: Floats
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(self, linear_xyz=(3,), angular_xyz=(3,))


@dataclass(frozen=True, eq=False)
class Twist:
    """Velocities asked for, as ``cmd_vel`` has them: (3,) in m/s and (3,) in rad/s.

    The message of ROS has no header; this one's is left behind on a ROS graph.
    """

    linear_xyz: Floats
    angular_xyz: Floats
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(self, linear_xyz=(3,), angular_xyz=(3,))
