"""Going back in what is live: a runtime whose topics show the present, or the last minutes."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping
from functools import partial
from pathlib import Path
from threading import RLock
from typing import Any

from ros_visualise.core import supervision
from ros_visualise.core.errors import DamagedMessage
from ros_visualise.core.limits import max_memory
from ros_visualise.core.message import Message
from ros_visualise.core.params import Parameters
from ros_visualise.data import Image
from ros_visualise.graph import Graph
from ros_visualise.messages.recorded import TopicType
from ros_visualise.messages.text_fields import may_have_texts
from ros_visualise.runtime.base import Runtime
from ros_visualise.runtime.queues import Inbox, Packet
from ros_visualise.runtime.recording import RecorderThread
from ros_visualise.runtime.report import RunReport
from ros_visualise.runtime.topics import Subscription
from ros_visualise.sinks.parts import Split
from ros_visualise.sources.playback import Playback
from ros_visualise.ui.live.live_buffer import Kept, LiveBuffer, PackedImage
from ros_visualise.ui.periodic import PeriodicThread

_SHARE = 4  # of the memory
_PERIOD_S, _CLOSE_S = 0.05, 0.3
_DEPTH = 200  # messages of a topic between two rounds; of images the newest


class RewoundSubscription(Subscription):
    """A topic as a page shows it: live, or from the past.

    Args:
        live: its messages of the present.
        depth: number of messages that may wait.
    """

    def __init__(self, topic: str, live: Subscription, depth: int, source: Rewinder) -> None:
        self._past = Inbox(lossless=False, keep=depth)
        super().__init__(topic, self._past, partial(source.leave, self))
        self.topic, self.live, self._source = topic, live, source
        self._heard: Callable[[], None] = lambda: None

    @property
    def dropped(self) -> int:
        return self.live.dropped

    def take(self, timeout_s: float, decode: bool = True) -> Any | None:
        found = super().take(0, decode)
        if found is None and self._source.past is not None:
            return super().take(timeout_s, decode)
        if found is None:
            found = self.live.take(timeout_s, decode)
            self.log_ns, self.epoch = self.live.log_ns, self._source.epoch + self.live.epoch
        return found

    def notify(self, heard: Callable[[], None]) -> None:
        self._heard = heard
        self.live.notify(heard)
        super().notify(heard)

    def put(self, packet: Packet) -> None:
        """Show a message of the past."""
        self._past.put(packet)

    def clear(self) -> None:
        """Drop what waits of the past."""
        while self._past.take(0) is not None:
            pass

    def close(self) -> None:
        """End it."""
        self.live.close()
        super().close()


class Rewinder:
    """A live runtime whose past can be shown; see `ros_visualise.runtime.base.Runtime`.

    While browsers look, the messages of topics that they show, and of those with texts, are kept:
    those of the last ten minutes within a quarter of `--max-memory`.

    Args:
        runtime: it is live.
        is_watched: returns True while a browser looks.

    Attributes:
        past: the playback of what is kept; None while the present is shown.
        epoch: number of jumps between past and present.
        stamp_ns: stamp of the message of the past that was shown last.
    """

    def __init__(self, runtime: Runtime, is_watched: Callable[[], bool]) -> None:
        self.name = runtime.name
        self.runtime, self._is_watched = runtime, is_watched
        self.buffer = LiveBuffer(max_memory() // _SHARE)
        self.past: Playback | None = None
        self.epoch = self.stamp_ns = 0
        self._start_ns = time.monotonic_ns()
        self._shown: set[RewoundSubscription] = set()
        self._kept: dict[str, Subscription] = {}
        self._text_topics: tuple[Graph, Mapping[str, type[Message]], Collection[str]] | None = None
        self._changing = RLock()
        self._thread = PeriodicThread("live buffer", self._keep, self._end, _PERIOD_S, lambda: True)
        self._thread.start()

    def close(self) -> None:
        """End all threads."""
        self.leave_past()
        self._thread.close(_CLOSE_S)

    # Going back

    @property
    def now_s(self) -> float:
        """The time of the newest kept message, which everything counts from the first one."""
        return self.buffer.duration_ns / 1e9

    def seek(self, time_s: float, paused: bool = False) -> None:
        """Show a time of the past, and go on from there."""
        with self._changing:
            if self.past is not None:
                self.past.seek(time_s)
                return
            past = self.past = Playback(start_s=time_s)
            if paused:
                past.pause()
                past.step()
            self.epoch += 1
            for shown in self._shown:
                shown.clear()
        supervision.start("past", partial(self._play, past))

    def leave_past(self) -> None:
        """Show the present again."""
        with self._changing:
            if self.past is not None:
                self._return(self.past)

    def _play(self, past: Playback) -> None:
        place_ns = 0
        for _, batch in past.run(self.buffer, bool):
            with self._changing:
                if self.past is not past:
                    return
                self._show(batch, past.epoch)
                place_ns = batch[-1].place_ns if batch else place_ns
                if not batch and place_ns >= self.buffer.duration_ns:
                    self._return(past)
                    return

    def _return(self, past: Playback) -> None:
        past.close()
        self.epoch += past.epoch + 1
        for shown in self._shown:
            shown.clear()
        _, batch = next(self.buffer.read(self.buffer.duration_ns), (0, ()))
        self._show(batch, 0)
        self.past = None

    def _show(
        self, batch: Collection[Kept], epoch: int, to: Collection[RewoundSubscription] = ()
    ) -> None:
        for one in batch:
            listening = [shown for shown in to or self._shown if shown.topic == one.topic]
            if listening:
                is_packed = isinstance(one.message, PackedImage)
                message = one.message.unpacked() if is_packed else one.message
                self.stamp_ns = message.header.stamp_ns
                jumps = self.epoch + epoch + max(shown.live.epoch for shown in self._shown)
                for shown in listening:
                    shown.put(Packet(0, message, time.monotonic_ns(), epoch=jumps))

    # Keeping

    @property
    def text_topics(self) -> Collection[str]:
        """The topics whose messages may have texts that a person searches."""
        graph, others = self.graph, self.diagnostic_topics
        known = self._text_topics
        if known is None or known[0] is not graph or known[1] != others:
            kinds = {t: TopicType(kind.type_name) for t, kind in others.items()}
            kinds |= {topic: spec.ros for topic, spec in graph.topics.items()}
            found = {topic for topic, kind in kinds.items() if may_have_texts(kind)}
            known = self._text_topics = graph, others, found
        return known[2]

    def _keep(self) -> None:
        self._follow()
        for topic, subscription in list(self._kept.items()):
            while (message := subscription.take(0, decode=False)) is not None:
                try:
                    self.buffer.add(time.monotonic_ns() - self._start_ns, topic, message)
                except DamagedMessage:
                    continue  # those who show it report it

    def _follow(self) -> None:
        """Keep the topics that are shown now, and those with texts, for a search."""
        is_watched = self._is_watched()
        with self._changing:
            wanted = {one.topic for one in self._shown} if is_watched else set()
        wanted |= set(self.text_topics if is_watched else ())
        for topic in self._kept.keys() - wanted:
            self._kept.pop(topic).close()
        for topic in wanted - self._kept.keys():
            spec = self.graph.topics.get(topic)
            is_small = topic in self.text_topics or (spec is not None and spec.type is not Image)
            self._kept[topic] = self.runtime.subscribe(topic, _DEPTH if is_small else 1)

    def _end(self) -> None:
        for subscription in self._kept.values():
            subscription.close()

    # The runtime

    @property
    def graph(self) -> Graph:
        return self.runtime.graph

    @property
    def diagnostic_topics(self) -> Mapping[str, type[Message]]:
        return self.runtime.diagnostic_topics

    @property
    def parameters(self) -> Mapping[str, Parameters[Any]]:
        return self.runtime.parameters

    @property
    def playback(self) -> Playback | None:
        return self.runtime.playback

    @property
    def publishes(self) -> bool:
        return self.runtime.publishes

    def subscribe(self, topic: str, depth: int = 1) -> Subscription:
        """Look at a topic, at the time that is shown."""
        shown = RewoundSubscription(topic, self.runtime.subscribe(topic, depth), depth, self)
        with self._changing:
            self._shown.add(shown)
            if self.past is not None:
                place_ns = round(self.past.state.position_s * 1e9)
                _, batch = next(self.buffer.read(place_ns), (0, ()))
                self._show(batch, self.past.epoch, (shown,))
        return shown

    def leave(self, shown: RewoundSubscription) -> None:
        """Forget a subscription that ends."""
        with self._changing:
            self._shown.discard(shown)

    def publish(self, topic: str, message: Any) -> None:
        self.runtime.publish(topic, message)

    def act(self, node: str, action: str) -> None:
        self.runtime.act(node, action)

    def report(self, window_s: float | None = None) -> RunReport:
        return self.runtime.report(window_s)

    def start_recording(
        self,
        path: str | Path,
        overwrite: bool = False,
        topics: Collection[str] = (),
        split: Split | None = None,
    ) -> RecorderThread:
        return self.runtime.start_recording(path, overwrite, topics, split)

    def stop_recording(self, recording: RecorderThread) -> None:
        self.runtime.stop_recording(recording)
