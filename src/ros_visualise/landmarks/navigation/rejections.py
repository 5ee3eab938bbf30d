"""What a person should look at: said once, when it has been so in several images."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from ros_visualise.landmarks.navigation.landmark_map import ImageOutcome

_SOON = 5  # images since it was right


class Rejections:
    """What images leave in doubt, such as tags that are refused whenever they are seen."""

    def __init__(self) -> None:
        self._often: Counter[str] = Counter()
        self._said: set[str] = set()

    def look(self, judged: ImageOutcome) -> Iterator[str]:
        """What there is to say after an image."""
        for name in judged.used:
            self._often.pop(name, None)
        for name, text in judged.doubts.items():
            self._often[name] += 1
            if self._often[name] >= _SOON and name not in self._said:
                self._said.add(name)
                yield text
