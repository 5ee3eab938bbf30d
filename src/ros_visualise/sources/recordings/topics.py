"""Which topics a recording has, out of the channels of its files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from ros_visualise.messages.qos import LATCHED, VOLATILE
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sources.recordings import Loss, TopicInfo, left_out
from ros_visualise.sources.recordings.storage import Channel, Storage, add_note


class Topics:
    """The topics of several files. Each is of one type, which can be read if any can.

    Attributes:
        by_name: in the order of their names.
        chosen: of each, a channel of its type.
    """

    def __init__(self, storages: Sequence[Storage], loss: Loss) -> None:
        self.by_name: dict[str, TopicInfo] = {}
        self.chosen: dict[str, Channel] = {}
        found: dict[str, list[tuple[Channel, int]]] = {}
        connections: Counter[str] = Counter()
        for storage in storages:
            for number, channel in storage.channels.items():
                found.setdefault(channel.topic, []).append((channel, storage.counts.get(number, 0)))
            connections |= Counter(channel.topic for channel in storage.channels.values())
        for topic in sorted(found):
            self.by_name[topic] = self._add(topic, found[topic], connections[topic], loss)

    def _add(
        self, topic: str, channels: Sequence[tuple[Channel, int]], connections: int, loss: Loss
    ) -> TopicInfo:
        chosen, _ = min(channels, key=lambda pair: (bool(pair[0].unreadable), not pair[1]))
        self.chosen[topic] = chosen
        alike = [pair for pair in channels if pair[0].is_like(chosen)]
        others = [pair for pair in channels if not pair[0].is_like(chosen)]
        for name in dict.fromkeys(channel.type_name for channel, _ in others):
            count = sum(count for channel, count in others if channel.type_name == name)
            loss.messages += count
            if count:
                add_note(loss, left_out(topic, count, name, chosen.type_name))
        return TopicInfo(
            TopicType(
                chosen.type_name,
                chosen.definitions,
                LATCHED if any(channel.latched for channel, _ in alike) else VOLATILE,
                "\n".join(_told(channel.offered_qos.strip() for channel, _ in alike)),
                _told(channel.callerid for channel, _ in alike),
                tuple(dict(label for channel, _ in alike for label in channel.labels).items()),
            ),
            sum(count for _, count in alike),
            chosen.digest,
            connections,
            chosen.unreadable,
            {channel.type_name: channel.digest for channel, _ in others},
        )


def _told(texts: Iterable[str]) -> tuple[str, ...]:
    """Each of them once, without empty ones."""
    return tuple(dict.fromkeys(filter(None, texts)))
