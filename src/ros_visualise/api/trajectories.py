"""Trajectories as NumPy arrays, and their errors."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from os import PathLike
from pathlib import Path as File

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import UsageError
from ros_visualise.data import Floats
from ros_visualise.geometry.trajectory_errors import parse_delta, statistics
from ros_visualise.plotting.trajectory_plot import (
    PlottedTrajectory,
    planes_of,
    plot_trajectories,
)
from ros_visualise.sinks.trajectory import FORMATS, save
from ros_visualise.sources import open_source
from ros_visualise.sources.comparison import Comparison, compare
from ros_visualise.sources.trajectories import Trajectory, read_trajectory
from ros_visualise.sources.trajectory_files import is_trajectory_file, read_trajectory_file


@dataclass(frozen=True)
class TrajectoryErrors:
    """Errors of a trajectory against the truth, defined as in the package evo.

    Attributes:
        stamps_ns: (N,) of the compared poses; their numbers, if these have no times.
        ate_m: (N,) absolute trajectory error of each, metres.
        ate_deg: (N,) of their attitudes, degrees; None if these are unknown, such as all 0 0 0 1.
        rpe_m: (P,) relative pose errors, metres; without attitudes, errors of the lengths of the
            steps; None without pairs.
        rpe_deg: (P,) of the rotations, degrees; None without attitudes, or without pairs.
        aligned: the trajectory in the place in which it was compared.
    """

    stamps_ns: npt.NDArray[np.int64]
    ate_m: Floats
    ate_deg: Floats | None
    rpe_m: Floats | None
    rpe_deg: Floats | None
    aligned: PoseTrajectory

    @property
    def rmse_m(self) -> float:
        """Root mean square of the absolute trajectory error, metres."""
        return statistics(self.ate_m)["rmse"]

    def summary(self) -> Mapping[str, Mapping[str, float]]:
        """Measure -> rmse, mean, median, std, min, max, sse and the number of pairs."""
        measures = {name: getattr(self, name) for name in ("ate_m", "ate_deg", "rpe_m", "rpe_deg")}
        return {
            name: {**statistics(values), "pairs": len(values)}
            for name, values in measures.items()
            if values is not None
        }


@dataclass(frozen=True)
class PoseTrajectory:
    """A trajectory; `ros_visualise.api.trajectory` reads one.

    Attributes:
        name: of its topic or file.
        frame_id: the frame of the poses; empty if unknown.
        stamps_ns: (N,) int64, nanoseconds, in order; zeros if it has no times.
        positions_xyz: (N, 3) float64, metres.
        quats_xyzw: (N, 4) float64, from the robot's frame to ``frame_id``.
    """

    name: str
    frame_id: str
    stamps_ns: npt.NDArray[np.int64]
    positions_xyz: Floats
    quats_xyzw: Floats
    _read: Trajectory

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @property
    def length_m(self) -> float:
        """Sum of the distances between successive positions, metres."""
        return float(np.linalg.norm(np.diff(self.positions_xyz, axis=0), axis=1).sum())

    @property
    def duration_s(self) -> float:
        """Time from the first pose to the last, seconds."""
        return float(self.stamps_ns[-1] - self.stamps_ns[0]) / 1e9

    def to_tum(self, path: str | PathLike[str], *, overwrite: bool = False) -> None:
        """Write a text file in the format of TUM, which evo reads.

        Raises:
            OpenError: it exists or cannot be written.
            UsageError: the trajectory has no times.
        """
        if not self._read.stamped:
            raise UsageError(f"{self.name}: has no time stamps, which the TUM format requires")
        save({File(path): "".join(FORMATS["tum"](self._read.path)).encode()}, overwrite)

    def align(
        self, truth: PoseTrajectory, how: str = "se3", *, max_difference_s: float = 0.01
    ) -> PoseTrajectory:
        """The trajectory, moved onto the truth.

        Args:
            truth: the true trajectory.
            how: ``origin``: by the first poses; ``se3``: by all positions; ``sim3``: with a scale.
            max_difference_s: of the stamps of two poses that match.

        Raises:
            UsageError: no matching poses, or they cannot be aligned like that.
        """
        return self.errors(truth, align=how, max_difference_s=max_difference_s).aligned

    def errors(
        self,
        truth: PoseTrajectory,
        *,
        align: str = "none",
        delta: str = "1f",
        max_difference_s: float = 0.01,
    ) -> TrajectoryErrors:
        """Errors against the truth; see `align`.

        Args:
            truth: the true trajectory.
            align: ``none``, or as ``how`` of `align`.
            delta: distance of the poses that the RPE compares: ``1f``, ``10m``, ``5deg``, ``1s``.
            max_difference_s: of the stamps of two poses that match.
        """
        found = compare(self._read, truth._read, align, parse_delta(delta), max_difference_s)
        return _errors(found)

    def _repr_html_(self) -> str:
        path = self._read.path
        figure = plot_trajectories(
            [PlottedTrajectory(self.name, path)],
            planes_of([path.positions_xyz]),
            f"{self.name}: {len(self)} poses, {self.length_m:.2f} m",
            self._read.stamped,
        )
        return figure.svg().decode()


def as_arrays(read: Trajectory) -> PoseTrajectory:
    """A trajectory that was read."""
    path, frame_id = read.path, read.path.header.frame_id
    arrays = path.stamps_ns, path.positions_xyz, path.quats_xyzw
    return PoseTrajectory(read.topic, frame_id, *arrays, read)


def trajectory(path: str | PathLike[str], topic: str | None = None) -> PoseTrajectory:
    """The trajectory in a recording, or in a text file of TUM, KITTI or EuRoC.

    Args:
        path: the file or folder.
        topic: of poses, odometry, fixes or a path, or two frames as ``/tf:PARENT.CHILD``; None: the
            only one.

    Raises:
        OpenError: it cannot be read.
        UsageError: no such topic, or several have poses.
        RosVisualiseError: it has no poses.
    """
    if is_trajectory_file(File(path)):
        if topic is not None:
            raise UsageError(f"{topic}: {path} is a text file without topics")
        return as_arrays(read_trajectory_file(File(path)))
    with closing(open_source(path)) as recording:
        return as_arrays(read_trajectory(recording, topic))


def _errors(found: Comparison) -> TrajectoryErrors:
    return TrajectoryErrors(
        found.moments,
        found.ate.translation_m,
        found.ate.rotation_deg if found.turns else None,
        found.rpe.translation_m if found.rpe else None,
        found.rpe.rotation_deg if found.rpe and found.turns else None,
        as_arrays(found.trajectory),
    )
