"""What sensors other than cameras measure."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from ros_visualise.data.header import Floats, Header, keep, read_only


@dataclass(frozen=True, eq=False)
class Imu:
    """Attitude, turn rates and accelerations in the frame of the header (REP 145).

    ``quat_xyzw`` (4,), ``angular_xyz`` (3,) in rad/s, ``linear_xyz`` (3,) in m/s^2, gravity
    included: at rest +9.8 upwards. Covariances are 3x3; all zero means that it is not known, a
    first element of -1 that the field is not measured at all.
    """

    quat_xyzw: Floats
    angular_xyz: Floats
    linear_xyz: Floats
    orientation_covariance: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    angular_covariance: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    linear_covariance: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(
            self,
            quat_xyzw=(4,),
            angular_xyz=(3,),
            linear_xyz=(3,),
            orientation_covariance=(3, 3),
            angular_covariance=(3, 3),
            linear_covariance=(3, 3),
        )


@dataclass(frozen=True, eq=False)
class NavSatFix:
    """A position on the WGS 84 ellipsoid: degrees, and metres above the ellipsoid.

    ``status`` and ``covariance_type`` are those of sensor_msgs/NavSatFix: a status below 0 is no
    fix. ``covariance`` is 3x3 in m^2, east, north, up. ``service`` are the systems used, as bits.
    """

    latitude: float
    longitude: float
    altitude: float
    covariance: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    covariance_type: int = 0
    status: int = 0
    service: int = 1
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(self, covariance=(3, 3))


@dataclass(frozen=True, eq=False)
class MagneticField:
    """The magnetic field (3,) in tesla in the frame of the header; covariance 3x3."""

    field_xyz: Floats
    covariance: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(self, field_xyz=(3,), covariance=(3, 3))


@dataclass(frozen=True)
class FluidPressure:
    """A pressure in pascal, and its variance in pascal^2."""

    pressure: float
    variance: float = 0.0
    header: Header = Header()


@dataclass(frozen=True, eq=False)
class LaserScan:
    """Distances in metres along rays in the x-y plane of the frame of the header (REP 117).

    ``ranges`` (N,): ray number i points to ``angle_min + i * angle_increment`` radians; what lies
    outside ``range_min`` to ``range_max`` is no measurement. ``intensities`` (N,), or empty.
    """

    ranges: npt.NDArray[np.float32]
    angle_min: float
    angle_max: float
    angle_increment: float
    range_min: float
    range_max: float
    intensities: npt.NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))
    time_increment: float = 0.0
    scan_time: float = 0.0
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(self, np.float32, ranges=(len(self.ranges),), intensities=(len(self.intensities),))


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Points in the frame of the header, with whatever was measured at each.

    ``points`` is a structured array, (N,) or (height, width) where they form an image; its fields
    are those of sensor_msgs/PointCloud2: ``x``, ``y`` and ``z`` in metres, often ``intensity``, or
    ``rgb``. Other layouts of the bytes, with gaps and in any order, are kept as they are.
    """

    points: npt.NDArray[np.void]
    is_dense: bool = True
    header: Header = Header()

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", read_only(self.points))

    @property
    def xyz(self) -> npt.NDArray[np.float32]:
        """(N, 3), a copy; points that are no numbers included."""
        columns = [self.points[name].ravel() for name in ("x", "y", "z")]
        return np.stack(columns, axis=1).astype(np.float32, copy=False)

    @property
    def nbytes(self) -> int:
        """Bytes of its points."""
        return int(self.points.nbytes)


@dataclass(frozen=True)
class TimeReference:
    """Another time, ``time_ns``, that goes with the stamp of the header; ``source`` names it."""

    time_ns: int
    source: str = ""
    header: Header = Header()
