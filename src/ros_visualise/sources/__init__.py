"""Sources of data: recordings, videos, cameras, and what is drawn or simulated."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ros_visualise.sources.recordings import Recording


def open_source(path: str | os.PathLike[str]) -> Recording:
    """Open a recording, or a video as a recording; raises OpenError if it cannot be opened."""
    from ros_visualise.sources import opening

    return opening.open_source(Path(path))


def info(path: str | os.PathLike[str], check: bool = False) -> dict[str, Any]:
    """Summary of a recording or a video, as ``ros-visualise info --json`` prints it.

    Args:
        path: the recording or video.
        check: read all messages, and report what cannot be read.

    Raises:
        OpenError: it cannot be opened.
    """
    from ros_visualise.sources import opening

    return opening.info(Path(path), check)
