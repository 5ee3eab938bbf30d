"""The topics that KITTI's drives and sequences share, and their frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Header, Path, Transforms, TransformStamped
from ros_visualise.geometry import transforms
from ros_visualise.sources.series import Series, single

MAP, ODOM, BASE = "map", "odom", "base_link"
IMU, VELODYNE = "imu_link", "velodyne"


def optical_frame(camera: int) -> str:
    """The optical frame of a camera."""
    return f"cam{camera:02d}_optical"


def static_series(start_ns: int, places: Sequence[tuple[str, str, Floats]]) -> Series:
    """``/tf_static``: one message with all of (parent, child, T_parent_child)."""
    sent = tuple(
        TransformStamped(child, *transforms.to_pose(T), Header(start_ns, parent))
        for parent, child, T in places
    )
    return single("/tf_static", Transforms(sent), start_ns)


def path_series(
    start_ns: int, stamps_ns: npt.NDArray[np.int64], positions_xyz: Floats, quats_xyzw: Floats
) -> Series:
    """``/path``: the whole way in one latched message at the start, so that a bag stays small."""
    order = np.argsort(stamps_ns, kind="stable")
    header = Header(start_ns, ODOM)
    path = Path(stamps_ns[order], positions_xyz[order], quats_xyzw[order], header)
    return single("/path", path, start_ns)


def moving_transforms(
    stamps_ns: npt.NDArray[np.int64], positions_xyz: Floats, quats_xyzw: Floats
) -> Series:
    """``/tf``: where base_link is in odom."""

    def make(index: int) -> Transforms:
        header = Header(int(stamps_ns[index]), ODOM)
        return Transforms(
            (TransformStamped(BASE, positions_xyz[index], quats_xyzw[index], header),)
        )

    return Series("/tf", Transforms, stamps_ns, make)
