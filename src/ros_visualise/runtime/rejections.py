"""Rejected messages: those that cannot go on are counted and logged; the others pass."""

from __future__ import annotations

import logging
import traceback
from typing import Any

import numpy as np

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import Header

log = logging.getLogger(__name__)

_STAMPS_NS = 2**63


class RejectedMessages:
    """Counts rejected messages, and logs each reason once for each topic.

    Reasons are identified by the place in the code that raised them, as the numbers in their texts
    would make each message a reason of its own.

    Args:
        where: what cannot hold the messages; a prefix in the log.

    Attributes:
        count: all of them.
    """

    def __init__(self, where: str = "") -> None:
        self.count = 0
        self._prefix = f"{where}: " if where else ""
        self._logged: set[tuple[object, ...]] = set()

    def add(self, topic: str, error: Exception) -> None:
        """Count a message."""
        self.count += 1
        reason = topic, *origin(error)
        if reason not in self._logged:
            self._logged.add(reason)
            what = "%s%s: message rejected: %s (further occurrences suppressed)"
            log.warning(what, self._prefix, topic, error)


def require_header(message: Any) -> None:
    """Check that a message has a valid header.

    Raises:
        DamagedMessage: it is missing or invalid.
    """
    kind = type(message).__name__
    try:
        header = message.header
    except Exception as error:  # as of invalid markers
        raise DamagedMessage(f"{kind} without a header: {error}") from error
    if not isinstance(header, Header) or not isinstance(header.frame_id, str):
        raise DamagedMessage(f"{kind}: {header!r} is not a valid header")
    stamp_ns = header.stamp_ns
    if not isinstance(stamp_ns, int | np.integer) or not -_STAMPS_NS <= stamp_ns < _STAMPS_NS:
        raise DamagedMessage(f"{kind}: {stamp_ns!r} is not a valid stamp in nanoseconds")


def origin(error: BaseException) -> tuple[object, ...]:
    """Type of the first cause of an error, and the line that raised it."""
    while error.__cause__ is not None:
        error = error.__cause__
    frames = traceback.extract_tb(error.__traceback__)
    place = (frames[-1].filename, frames[-1].lineno) if frames else ()
    return type(error), *place
