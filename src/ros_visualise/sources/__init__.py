"""Where data comes from."""

from __future__ import annotations

import os
from contextlib import closing
from pathlib import Path
from typing import Any


def info(path: str | os.PathLike[str]) -> dict[str, Any]:
    """What a recording or a video holds, as ``ros-visualise info --json`` prints it.

    Raises:
        OpenError: it cannot be opened.
    """
    from ros_visualise.sources.recordings import is_recording, open_recording

    if not is_recording(Path(path)):
        from ros_visualise.sources.video import describe  # PyAV takes a while to import

        return describe(path)
    from ros_visualise.sources.recordings.summary import summarize

    with closing(open_recording(Path(path))) as recording:
        return summarize(recording)
