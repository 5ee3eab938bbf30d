"""Messages that cannot go on: one is refused, the others pass."""

from __future__ import annotations

import logging
import traceback
from typing import Any

import numpy as np

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import Header

log = logging.getLogger(__name__)

_STAMPS_NS = 2**63


class Refusals:
    """Counts refused messages, and says each reason once for each topic.

    Reasons are told apart by the place in the code where they come from: the numbers in their words
    would make each message a reason of its own.

    Args:
        where: what cannot hold them; stands before their topic.

    Attributes:
        count: all of them.
    """

    def __init__(self, where: str = "") -> None:
        self.count = 0
        self._before = f"{where}: " if where else ""
        self._said: set[tuple[object, ...]] = set()

    def add(self, topic: str, error: Exception) -> None:
        """Count a message."""
        self.count += 1
        reason = topic, *_origin(error)
        if reason not in self._said:
            self._said.add(reason)
            what = "%s%s: message refused: %s (further occurrences suppressed)"
            log.warning(what, self._before, topic, error)


def require_header(message: Any) -> None:
    """See that a message has a header by which it can be handled.

    Raises:
        DamagedMessage: it has not.
    """
    kind = type(message).__name__
    try:
        header = message.header
    except Exception as error:  # as of markers that are none
        raise DamagedMessage(f"{kind} without a header: {error}") from error
    if not isinstance(header, Header) or not isinstance(header.frame_id, str):
        raise DamagedMessage(f"{kind}: {header!r} is not a valid header")
    stamp_ns = header.stamp_ns
    if not isinstance(stamp_ns, int | np.integer) or not -_STAMPS_NS <= stamp_ns < _STAMPS_NS:
        raise DamagedMessage(f"{kind}: {stamp_ns!r} is not a valid stamp in nanoseconds")


def _origin(error: BaseException) -> tuple[object, ...]:
    """Where in the code an error first arose, and its kind there."""
    while error.__cause__ is not None:
        error = error.__cause__
    frames = traceback.extract_tb(error.__traceback__)
    place = (frames[-1].filename, frames[-1].lineno) if frames else ()
    return type(error), *place
