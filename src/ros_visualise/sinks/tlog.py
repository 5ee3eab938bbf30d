"""Recording MAVLink to a telemetry log, which ground stations open too."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ros_visualise.core.errors import UsageError
from ros_visualise.data import Octets
from ros_visualise.messages.recorded import TopicType, content
from ros_visualise.sinks.one_file import AppendingRecorder


def mavlink_topics(path: Path, topics: Mapping[str, TopicType]) -> list[str]:
    """The topics of MAVLink: bytes, on topics of that name; raises UsageError without any."""
    found = [
        topic
        for topic, kind in topics.items()
        if kind.data_class is Octets and topic.endswith("/mavlink")
    ]
    if not found:
        raise UsageError(f"{path}: no MAVLink topic to record; connect a vehicle with --mavlink")
    return found


class TlogRecorder(AppendingRecorder):
    """Frames, each after its time: what messages hold, one after the other."""

    def _encoded(self, message: Any) -> bytes:
        data: bytes = content(message).data.tobytes()
        return data
