"""Inputs of ``trajectory``: topics of one recording, other files, and the truth."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from ros_visualise.commands.trajectory import TrajectoryOptions
from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.sinks.names import parse_target
from ros_visualise.sources.opening import open_source
from ros_visualise.sources.recordings import Recording
from ros_visualise.sources.trajectories import Trajectory, has_poses, read_trajectory
from ros_visualise.sources.trajectory_files import is_trajectory_file, read_trajectory_file

_TEXTS = (".txt", ".tum", ".kitti", ".csv")


@dataclass
class Inputs:
    """Trajectories of the command line.

    Attributes:
        trajectories: at least one, in the order of the command line.
        truth: the true trajectory, if any.
        notes: damage of the inputs, a line each.
    """

    trajectories: list[Trajectory] = field(default_factory=list)
    truth: Trajectory | None = None
    notes: list[str] = field(default_factory=list)

    @property
    def all(self) -> list[Trajectory]:
        """All trajectories, the truth last."""
        return [*self.trajectories, *([self.truth] if self.truth else [])]


def files_read(options: TrajectoryOptions) -> list[Path]:
    """All files to read."""
    named = [*options.beside, *([options.truth] if options.truth else [])]
    return [Path(options.input), *(parse_target(name)[0] for name in named)]


def read_inputs(options: TrajectoryOptions) -> Inputs:
    """Read all trajectories of the command line.

    Raises:
        UsageError: unknown file or topic, or an ambiguous one.
        RosVisualiseError: one has no poses.
    """
    inputs = Inputs()
    with _opened(Path(options.input), inputs) as source:
        inputs.truth = _truth(source, options.truth, inputs)
        but = inputs.truth.topic if inputs.truth else None
        inputs.trajectories += [_read(source, one, but) for one in options.topic or (None,)]
    for name in options.beside:
        inputs.trajectories += _read_named(name, inputs)
    return inputs


def _truth(source: Path | Recording, name: str | None, inputs: Inputs) -> Trajectory | None:
    """The truth: a topic of the recording, or else a file of that name."""
    if name is None:
        return None
    is_topic = not isinstance(source, Path) and has_poses(source, name)
    if is_topic or not os.path.exists(parse_target(name)[0]):
        return _read(source, name)
    found = _read_named(name, inputs)
    if len(found) > 1:
        raise UsageError(f"--truth {name}: give one topic")
    return found[0]


def _read_named(name: str, inputs: Inputs) -> list[Trajectory]:
    """The trajectories of FILE[@TOPIC[,TOPIC...]], named after both."""
    path, topics = parse_target(name)
    with _opened(path, inputs) as source:
        found = [_read(source, topic) for topic in topics or (None,)]
    if isinstance(source, Path):
        return found
    return [replace(one, topic=f"{path}@{one.topic}") for one in found]


def _read(source: Path | Recording, topic: str | None, but: str | None = None) -> Trajectory:
    if not isinstance(source, Path):
        return read_trajectory(source, topic, but)
    if topic is not None:
        raise UsageError(f"{source} has no topics, and there is no file named {topic}")
    return read_trajectory_file(source)


@contextmanager
def _opened(path: Path, inputs: Inputs) -> Iterator[Path | Recording]:
    """A recording, or a path of a text file with a trajectory."""
    if is_trajectory_file(path):
        yield path
        return
    if path.suffix.lower() in _TEXTS and os.path.isfile(path):
        raise OpenError(
            f"{path}: no trajectory; its lines have neither TUM's 8 numbers (time x y z qx qy qz"
            " qw) nor KITTI's 12, nor EuRoC's time,x,y,z,qw,qx,qy,qz"
        )
    with closing(open_source(path)) as recording:
        yield recording
        inputs.notes += [f"{path}: {note}" for note in recording.loss.notes]
