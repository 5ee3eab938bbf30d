"""Sources of data: recordings, videos, cameras, and what is drawn or simulated."""

from __future__ import annotations

import os
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ros_visualise.core.errors import OpenError

if TYPE_CHECKING:
    from ros_visualise.sources.recordings import Recording


def open_source(path: str | os.PathLike[str]) -> Recording:
    """Open a recording, or a video as a recording.

    Raises:
        OpenError: it cannot be opened; the message says what to do.
    """
    from ros_visualise.sources.opening import open_recording

    if not _may_be_video(Path(path)):
        return open_recording(Path(path))
    from ros_visualise.sources.demux import NoVideo
    from ros_visualise.sources.recordings.video import VideoRecording

    try:
        return VideoRecording(path)
    except NoVideo:
        raise _neither(path) from None


def info(path: str | os.PathLike[str], check: bool = False) -> dict[str, Any]:
    """What a recording or a video holds, as ``ros-visualise info --json`` prints it.

    Args:
        path: of the recording or video.
        check: read all messages, and tell what cannot be read.

    Raises:
        OpenError: it cannot be opened.
    """
    from ros_visualise.sources.opening import open_recording
    from ros_visualise.sources.recordings.summary import read_through, summarize

    if _may_be_video(Path(path)):
        return _describe_video(path, check)
    with closing(open_recording(Path(path))) as recording:
        if check:
            read_through(recording)
        return summarize(recording)


def _describe_video(path: str | os.PathLike[str], check: bool) -> dict[str, Any]:
    from ros_visualise.sources.demux import NoVideo  # PyAV takes a while to import
    from ros_visualise.sources.recordings.summary import read_through
    from ros_visualise.sources.video import describe

    try:
        found = describe(path)
    except NoVideo:
        raise _neither(path) from None
    if check:
        with closing(open_source(path)) as recording:
            read_through(recording)
            found["lost"]["notes"] = list(recording.loss.notes)
    return found


def _may_be_video(path: Path) -> bool:
    from ros_visualise.sources.opening import is_recording

    return os.path.isfile(path) and not is_recording(path)


def _neither(path: str | os.PathLike[str]) -> OpenError:
    from ros_visualise.sources.formats import kinds
    from ros_visualise.sources.opening import unknown_file

    what = f"neither a recording ({kinds()}) nor a video that FFmpeg can read"
    return unknown_file(Path(path), what, "check the path, or copy it again")
