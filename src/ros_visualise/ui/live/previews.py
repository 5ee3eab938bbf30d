"""Previews while a person seeks in a film: its key images, until the exact image comes."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

from ros_visualise.core import supervision
from ros_visualise.data import Header, Image
from ros_visualise.graph import Graph
from ros_visualise.sources.playback import Playback, Sought

_GRACE_S = 0.02
"""The exact image has so long to come without a preview."""
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
        supervision.start("previews", self._run)

    def close(self) -> None:
        """End it, without waiting."""
        self._closed = True

    def _run(self) -> None:
        done = 0
        while not (self._closed or self._playback.closed):
            seek = self._playback.await_seek(done, _LOOK_S)
            if seek is not None:
                done = seek.number
                time.sleep(_GRACE_S)
                self._follow(seek)

    def _follow(self, seek: Sought) -> None:
        find, is_awaited = self._playback.key_image, self._playback.is_awaited
        if find is None or not (self._is_wanted() and is_awaited(seek)):
            return
        found = find(seek.target_ns)
        if found is None or not is_awaited(seek):
            return
        time_ns, image = found
        if abs(time_ns - seek.target_ns) < abs(seek.before_ns - seek.target_ns):
            self._show(replace(image, header=Header(time_ns)))


def shows_source(graph: Graph) -> set[str]:
    """The topics of a source's images, also where a node only lets them pass."""
    source = graph.source
    found = set() if source is None else set(source.topics_of(Image))
    for node in graph.nodes:
        if node.type.drops and found & set(node.inputs.values()):
            found |= set(node.topics_of(Image))
    return found
