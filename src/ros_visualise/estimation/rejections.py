"""Warnings about persistent rejections, once each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from ros_visualise.estimation.landmark_map import ImageOutcome

_SOON = 5  # rejections before the warning


class Rejections:
    """Counts rejections, such as of tags that never fit, until they are worth a warning."""

    def __init__(self) -> None:
        self._often: Counter[str] = Counter()
        self._said: set[str] = set()

    def look(self, outcome: ImageOutcome) -> Iterator[str]:
        """The warnings due after an image."""
        for name in outcome.used:
            self._often.pop(name, None)
        for name, text in outcome.advice.items():
            self._often[name] += 1
            if self._often[name] >= _SOON and name not in self._said:
                self._said.add(name)
                yield text
