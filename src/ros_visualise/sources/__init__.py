"""Where data comes from."""

from __future__ import annotations

import os
from typing import Any


def info(path: str | os.PathLike[str]) -> dict[str, Any]:
    """What a source holds, as ``ros-visualise info --json`` prints it.

    Raises:
        OpenError: it cannot be opened.
    """
    from ros_visualise.sources.video import describe  # PyAV takes a while to import

    return describe(path)
