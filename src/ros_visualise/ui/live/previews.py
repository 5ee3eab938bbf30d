"""Previews while a person seeks in a film: images that are found at once, until the exact one."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

from ros_visualise.core import supervision
from ros_visualise.data import Header, Image
from ros_visualise.graph import Graph
from ros_visualise.sources.playback import Playback, Sought

_GRACE_S = 0.01
"""The exact image has so long to come without a preview."""
_AGAIN_S, _LATE_S = 0.1, 0.3
"""Period of looking for nearer ones; time after which going back shows even one too far back."""
_LOOK_S = 0.5


class Previews:
    """Shows previews on a thread of its own, until it is closed.

    Args:
        show: takes each preview.
        is_wanted: returns True while a browser shows images.
    """

    def __init__(
        self, playback: Playback, show: Callable[[Image], None], is_wanted: Callable[[], bool]
    ) -> None:
        self._playback, self._show, self._is_wanted = playback, show, is_wanted
        self._closed = False
        self._played, self._shown_ns = -1, 0
        supervision.start("previews", self._run)

    def close(self) -> None:
        """End it, without waiting."""
        self._closed = True

    def _run(self) -> None:
        done = 0
        while not self._is_over():
            seek = self._playback.await_seek(done, _LOOK_S)
            if seek is not None:
                done = seek.number
                time.sleep(_GRACE_S)
                self._follow(seek)

    def _is_over(self) -> bool:
        return self._closed or self._playback.closed

    def _follow(self, seek: Sought) -> None:
        """Show what is nearer than what is shown, until the exact image or the next seek comes."""
        find, is_awaited = self._playback.key_image, self._playback.is_awaited
        if seek.played != self._played:
            self._played, self._shown_ns = seek.played, seek.before_ns
        late_s = time.monotonic() + _LATE_S
        while find is not None and self._is_wanted() and is_awaited(seek) and not self._is_over():
            found = find(seek.target_ns)
            is_late = time.monotonic() > late_s
            if found and is_awaited(seek) and self._leads(found[0], seek.target_ns, is_late):
                self._shown_ns, image = found
                self._show(replace(image, header=Header(self._shown_ns)))
            if self._playback.await_seek(seek.number, _AGAIN_S) is not None:
                return

    def _leads(self, time_ns: int, target_ns: int, is_late: bool) -> bool:
        """True for a time nearer than that shown; late, for any on the way back."""
        if is_late and target_ns < self._shown_ns:
            return time_ns < self._shown_ns
        return abs(time_ns - target_ns) < abs(self._shown_ns - target_ns)


def shows_source(graph: Graph) -> set[str]:
    """The topics of a source's images, also where a node only lets them pass."""
    source = graph.source
    found = set() if source is None else set(source.topics_of(Image))
    for node in graph.nodes:
        if node.type.drops and found & set(node.inputs.values()):
            found |= set(node.topics_of(Image))
    return found
