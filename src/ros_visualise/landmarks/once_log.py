"""Warnings that are logged once."""

from __future__ import annotations

import logging

log = logging.getLogger(__name__)


class OnceLog:
    """Warnings of one node, each logged once.

    Args:
        name: of the node.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._said: set[str] = set()

    def say(self, text: str) -> None:
        """Log a warning unless it was logged before."""
        if text not in self._said:
            self._said.add(text)
            log.warning("%s: %s (further occurrences suppressed)", self._name, text)
