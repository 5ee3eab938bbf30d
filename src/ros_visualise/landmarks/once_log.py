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

    def say(self, text: str, subject: str = "") -> None:
        """Log a warning unless it, or another one on its subject, was logged before."""
        key = subject or text
        if key not in self._said:
            self._said.add(key)
            log.warning("%s: %s (further occurrences suppressed)", self._name, text)
