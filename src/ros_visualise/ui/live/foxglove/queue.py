"""Messages on their way to one viewer."""

from __future__ import annotations

import asyncio
from collections import Counter, deque
from itertools import count
from typing import NamedTuple

from ros_visualise.ui.live.foxglove.messages import message_head

_MOST_MESSAGES = 100  # of a channel
_MOST_BYTES = 16 << 20
_MOST_REPLY_BYTES = 1 << 20


class _Waiting(NamedTuple):
    number: int
    head: bytes
    data: bytes | memoryview


class ViewerQueue:
    """Replies, which are kept, and messages of channels; the oldest messages are dropped.

    Of each channel 100 messages wait at most, of all 16 MiB, and always the newest one.

    Attributes:
        dropped: number of dropped messages of each channel.
    """

    def __init__(self) -> None:
        self.dropped: Counter[int] = Counter()
        self._replies: deque[str | bytes] = deque()
        self._reply_bytes = 0
        self._waiting: dict[int, deque[_Waiting]] = {}
        self._bytes = 0
        self._numbers = count()
        self._news, self._room = asyncio.Event(), asyncio.Event()
        self._room.set()

    @property
    def waits(self) -> bool:
        """True if something waits."""
        return bool(self._replies or self._waiting)

    @property
    def has_room(self) -> bool:
        """True unless many replies wait."""
        return self._room.is_set()

    async def wait_for_room(self) -> None:
        """Wait until few replies wait."""
        await self._room.wait()

    def reply(self, message: str | bytes) -> None:
        """Add a reply."""
        self._replies.append(message)
        self._count(len(message))
        self._news.set()

    def put(self, channel: int, subscription: int, log_ns: int, data: bytes | memoryview) -> None:
        """Add a message of a channel."""
        waiting = self._waiting.setdefault(channel, deque())
        waiting.append(_Waiting(next(self._numbers), message_head(subscription, log_ns), data))
        self._bytes += len(data)
        if len(waiting) > _MOST_MESSAGES:
            self._drop(channel)
        while self._bytes > _MOST_BYTES and (fullest := self._fullest()) is not None:
            self._drop(fullest)
        self._news.set()

    def forget(self, channel: int) -> None:
        """Remove the messages of a channel."""
        for waiting in self._waiting.pop(channel, ()):
            self._bytes -= len(waiting.data)

    async def take(self) -> str | bytes:
        """The next to be sent: replies first, then the message that waited longest."""
        while not self.waits:
            self._news.clear()
            await self._news.wait()
        if self._replies:
            reply = self._replies.popleft()
            self._count(-len(reply))
            return reply
        channel = min(self._waiting, key=lambda one: self._waiting[one][0].number)
        found = self._remove(channel)
        return found.head + found.data

    def _count(self, size: int) -> None:
        self._reply_bytes += size
        if self._reply_bytes > _MOST_REPLY_BYTES:
            self._room.clear()
        else:
            self._room.set()

    def _fullest(self) -> int | None:
        """The channel with the most bytes, of those where several messages wait."""
        sizes = {
            channel: sum(len(one.data) for one in waiting)
            for channel, waiting in self._waiting.items()
            if len(waiting) > 1
        }
        return max(sizes, key=sizes.__getitem__, default=None)

    def _drop(self, channel: int) -> None:
        self._remove(channel)
        self.dropped[channel] += 1

    def _remove(self, channel: int) -> _Waiting:
        waiting = self._waiting[channel]
        found = waiting.popleft()
        self._bytes -= len(found.data)
        if not waiting:
            del self._waiting[channel]
        return found
