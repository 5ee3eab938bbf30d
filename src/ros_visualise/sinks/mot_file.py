"""Recording the tracks of a topic as the MOTChallenge has them, for its tools and metrics."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from pathlib import Path
from typing import Any

from ros_visualise.core.errors import UsageError
from ros_visualise.data import Detections
from ros_visualise.messages.recorded import TopicType, content
from ros_visualise.sinks.one_file import AppendingRecorder


def choose_topic(path: Path, topics: Mapping[str, TopicType], named: bool) -> str:
    """The topic that a .txt stores: the named one, or the last one of detections in images.

    Raises:
        UsageError: no such topic, or something else was named.
    """
    found = [topic for topic, kind in topics.items() if kind.data_class is Detections]
    if named and (len(topics) > 1 or not found):
        raise UsageError(
            f"{path}: a .txt can store only one topic with tracks or detections; record to .mcap"
            f" instead"
        )
    if not found:
        raise UsageError(f"{path}: no topic with tracks or detections to record")
    return found[-1]


class MotRecorder(AppendingRecorder):
    """A row for each detection: frame, id, left, top, width, height, score, -1, -1, -1.

    Frames are the messages of the topic, from 1. Pixels are numbered from 1. Things without an id
    have -1, as in files of detections; ids that are no numbers are numbered.

    Source: Milan et al., MOT16: a benchmark for multi-object tracking, 2016, table 5.
    """

    def __init__(self, path: Path, topic: str, overwrite: bool, live: bool) -> None:
        super().__init__(path, [topic], overwrite, live)
        self._numbers: dict[str, int] = {}

    def _encoded(self, message: Any) -> bytes:
        return self._rows(content(message)).encode()

    def _rows(self, found: Detections) -> str:
        rows = []
        for one, (u, v, width, height) in zip(
            found.detections, found.boxes_uv.tolist(), strict=True
        ):
            if width > 0 and height > 0 and isfinite(u + v):
                score = one.score if one.hypotheses else 1.0
                box = f"{u - width / 2 + 1:.2f},{v - height / 2 + 1:.2f},{width:.2f},{height:.2f}"
                id = self._number_of(one.id)
                rows.append(f"{self._written + 1},{id},{box},{score:.4g},-1,-1,-1\n")
        return "".join(rows)

    def _number_of(self, id: str) -> int:
        if id.isdecimal() or not id:
            return int(id or -1)
        return self._numbers.setdefault(id, len(self._numbers) + 1)
