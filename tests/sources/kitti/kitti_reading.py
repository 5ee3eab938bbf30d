"""Reading KITTI's recordings, and changing their folders."""

from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from ros_visualise.geometry import se3
from ros_visualise.sources.recordings.series import SeriesRecording


def replace_file(path: Path, data: bytes) -> None:
    """Put other bytes in place of a link."""
    path.unlink()
    path.write_bytes(data)


def messages(recording: SeriesRecording, topic: str) -> list[Any]:
    """All messages of one topic."""
    with closing(recording.read(topics=[topic])) as entries:
        return [entry.message for entry in entries]


def fixed_transform(recording: SeriesRecording, target: str, source: str) -> np.ndarray:
    """T_target_source from ``/tf_static``, where target is above source."""
    sent = messages(recording, "/tf_static")[0].transforms
    above = {one.child_frame_id: one for one in sent}
    T = np.eye(4)
    while source != target:
        one = above[source]
        T = se3.from_pose(one.translation_xyz, one.quat_xyzw) @ T
        source = one.header.frame_id
    return T
