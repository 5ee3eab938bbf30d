"""Data sets for learning, made of the results of a batch: a module for each format.

Each has a function ``write(source, folder)`` and is named after the format. Whole recordings are
for training or for validation, as the images of one are alike.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from ros_visualise.batch.comparison import FrameBoxes, frames_of
from ros_visualise.batch.pictures import images_at
from ros_visualise.batch.results import Results
from ros_visualise.batch.tables import RECORDED
from ros_visualise.core.errors import UsageError

SPLITS = ("train", "val")
_QUALITY = 95  # of JPEG files
_USED = {"detections": "label != ''", "poses": RECORDED}
"""Table -> the rows of it that a data set needs."""
_MAKING = {
    "detections": "run the batch with --pipeline landmarks, or a --node that detects objects",
    "poses": "run the batch on recordings that have odometry or poses",
}
"""Table -> how to have such rows."""


@dataclass(frozen=True)
class DatasetSource:
    """The results that a data set is made of.

    Attributes:
        results: folder of a batch.
        validation: share of the recordings for validation; with two recordings or more at least
            one, unless it is 0.
        every: of the images with detections every n-th.
        action: topic in the table of fields whose numbers are the actions of a robot; empty: the
            velocities of the poses.
    """

    results: Path
    validation: float = 0.2
    every: int = 1
    action: str = ""


class LabelledImage(NamedTuple):
    """A picture that was written, with its detections within it, and where it comes from."""

    file: str
    split: str
    width: int
    height: int
    found: FrameBoxes
    origin: Mapping[str, Any]


class SplitRecording(NamedTuple):
    """A recording, and the split that it belongs to."""

    name: str
    path: str
    content: str
    split: str


def split_recordings(source: DatasetSource, table: str) -> list[SplitRecording]:
    """The recordings with usable rows of a table; the same ones are for validation each time.

    Raises:
        UsageError: no such rows.
    """
    with closing(Results(source.results).open_tables()) as sql:
        rows = sql.execute(
            "SELECT recording, path, content FROM recordings SEMI JOIN"
            f" (SELECT recording FROM {table} WHERE {_USED[table]}) USING (recording)"
            " ORDER BY content, recording"
        ).fetchall()
    if not rows:
        raise UsageError(f"{source.results}: no {table}; {_MAKING[table]}")
    count = round(len(rows) * source.validation)
    if source.validation and len(rows) > 1:
        count = min(max(count, 1), len(rows) - 1)
    split = [
        SplitRecording(name, path, content, SPLITS[at < count])
        for at, (name, path, content) in enumerate(rows)
    ]
    return sorted(split, key=lambda one: (one.split, one.name))


def labelled_images(source: DatasetSource, folder: Path) -> Iterator[LabelledImage]:
    """Write the images with detections below ``folder/images``.

    Raises:
        UsageError: no detections.
        RosVisualiseError: a recording is missing by now.
    """
    for recording in split_recordings(source, "detections"):
        with closing(Results(source.results).open_tables()) as sql:
            rows = sql.execute(
                "SELECT * FROM detections WHERE recording = ? AND label != '' ORDER BY t_ns",
                [recording.name],
            ).fetchnumpy()
            inputs = sql.execute(
                "SELECT DISTINCT inputs FROM nodes SEMI JOIN detections USING (recording, node)"
                " WHERE recording = ?",
                [recording.name],
            ).fetchall()
        frames = frames_of(rows)
        wanted = list(frames)[:: source.every]
        topics = {topic for (text,) in inputs for topic in text.split(",")}
        for t_ns, pixels in images_at(recording.path, wanted, topics):
            name = f"{plain_name(recording.name)}_{t_ns}.jpg"
            file = Path("images") / recording.split / name
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(folder / file), pixels, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
            height, width = pixels.shape[:2]
            found = _within(frames[t_ns], width, height)
            origin = {"recording": recording.name, "t_ns": t_ns, "content": recording.content}
            yield LabelledImage(str(file), recording.split, width, height, found, origin)


def plain_name(recording: str) -> str:
    """A recording's name as a part of a file's."""
    return re.sub(r"[^\w.-]", "_", recording)


def provenance(source: DatasetSource) -> dict[str, Any]:
    """The work by which the results were made."""
    work = Results(source.results).read_plan()[0]["work"]
    return {"made_by": f"ros_visualise {work['version']}", "work": json.dumps(work)}


def _within(found: FrameBoxes, width: int, height: int) -> FrameBoxes:
    """The boxes clipped to the image; those outside of it are dropped."""
    low = np.clip(found.boxes[:, :2], 0, [width, height])
    high = np.clip(found.boxes[:, :2] + found.boxes[:, 2:], 0, [width, height])
    boxes = np.concatenate([low, high - low], axis=1)
    kept = np.flatnonzero((boxes[:, 2:] > 0).all(axis=1)).tolist()
    return FrameBoxes([found.labels[at] for at in kept], boxes[kept])
