"""What a detector says of itself, each thing once."""

from __future__ import annotations

import logging

log = logging.getLogger(__name__)


class OnceLog:
    """Warnings of one node, each of which is logged once.

    Args:
        name: of the node.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._said: set[str] = set()

    def say(self, text: str) -> None:
        """Log it, unless it was said before."""
        if text not in self._said:
            self._said.add(text)
            log.warning("%s: %s (said once)", self._name, text)
