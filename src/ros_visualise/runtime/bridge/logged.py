"""What this package logs, on the log of a graph."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping

from ros_visualise.core.printing import Shown


def log_to(say: Mapping[int, Callable[[str], object]]) -> logging.Handler:
    """Hand what this package logs to a graph, which prints it as well, from now on.

    Args:
        say: level of `logging` -> what says a text on that level.
    """
    handler = _ToGraph(say)
    handler.setFormatter(Shown())
    log = logging.getLogger("ros_visualise")
    log.addHandler(handler)
    log.setLevel(logging.INFO)
    return handler


class _ToGraph(logging.Handler):
    def __init__(self, say: Mapping[int, Callable[[str], object]]) -> None:
        super().__init__()
        self._say = say

    def emit(self, record: logging.LogRecord) -> None:
        level = max(level for level in self._say if level <= max(record.levelno, logging.DEBUG))
        self._say[level](self.format(record))
