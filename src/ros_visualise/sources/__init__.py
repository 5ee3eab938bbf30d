"""Where data comes from."""

from __future__ import annotations

import os
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ros_visualise.errors import OpenError

if TYPE_CHECKING:
    from ros_visualise.sources.recordings import Recording


def open_source(path: str | os.PathLike[str]) -> Recording:
    """A recording, or a video as one.

    Raises:
        OpenError: it cannot be opened; the message says what to do.
    """
    from ros_visualise.sources.recordings.opening import open_recording

    if not _may_be_video(Path(path)):
        return open_recording(Path(path))
    from ros_visualise.sources.demux import NoVideo
    from ros_visualise.sources.recordings.video import VideoRecording

    try:
        return VideoRecording(path)
    except NoVideo:
        raise _neither(path) from None


def info(path: str | os.PathLike[str]) -> dict[str, Any]:
    """What a recording or a video holds, as ``ros-visualise info --json`` prints it.

    Raises:
        OpenError: it cannot be opened.
    """
    if _may_be_video(Path(path)):
        from ros_visualise.sources.demux import NoVideo  # PyAV takes a while to import
        from ros_visualise.sources.video import describe

        try:
            return describe(path)
        except NoVideo:
            raise _neither(path) from None
    from ros_visualise.sources.recordings.opening import open_recording
    from ros_visualise.sources.recordings.summary import summarize

    with closing(open_recording(Path(path))) as recording:
        return summarize(recording)


def _may_be_video(path: Path) -> bool:
    from ros_visualise.sources.recordings.opening import is_recording

    return path.is_file() and not is_recording(path)


def _neither(path: str | os.PathLike[str]) -> OpenError:
    from ros_visualise.sources.recordings.opening import KINDS, unknown_file

    what = f"neither a recording ({KINDS}) nor a video that FFmpeg can read"
    return unknown_file(Path(path), what, "check the path, or copy it again")
