"""When time jumps: the stamps on a topic go back, as when a recording starts over elsewhere."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

from ros_visualise.data.frames import is_static

_LATE_NS = 1_000_000_000  # messages come late, and those who send transforms disagree
_SETTLED_NS = 1_000_000_000  # after so long, all topics have jumped that do


class _Jump(NamedTuple):
    topic: str
    from_ns: int
    at_ns: int


_NONE = _Jump("", 0, 0)


class Epochs:
    """Counts how often time has jumped, so that whoever remembers can begin anew.

    Time jumps where the stamps on a topic go back by more than a second. Topics jump one after the
    other: what still comes on the others from before the jump is of the epoch before. Messages
    without a stamp (0), topics on which two clocks take turns, and those of static transforms tell
    no time.

    Args:
        timeless: other topics that tell no time.
    """

    def __init__(self, timeless: Collection[str] = ()) -> None:
        self._epoch = 0
        self._newest_ns: dict[str, int] = {}  # topic -> its newest stamp in this epoch
        self._before_ns: dict[str, int] = {}  # and in the one before
        self._jump = _NONE
        self._timeless = set(timeless)

    def begin(self) -> None:
        """Time jumps, for all topics at once: somebody went elsewhere."""
        self._epoch += 1
        self._newest_ns, self._before_ns, self._jump = {}, {}, _NONE

    def of(self, topic: str, stamp_ns: int, now_ns: int) -> int:
        """The epoch of the next message on a topic; ``now_ns`` is of a time that only goes on."""
        if not stamp_ns:
            return self._epoch
        is_settled = now_ns > self._jump.at_ns + _SETTLED_NS
        if topic == self._jump.topic and stamp_ns >= self._jump.from_ns and not is_settled:
            self._timeless.add(topic)
        if topic in self._timeless or is_static(topic):
            return self._epoch
        newest_ns = self._newest_ns.get(topic, stamp_ns)
        if stamp_ns < newest_ns - _LATE_NS:
            before_ns, jump = self._newest_ns, _Jump(topic, newest_ns, now_ns)
            self.begin()
            self._before_ns, self._jump, newest_ns = before_ns, jump, stamp_ns
        elif not is_settled and self._is_of_before(topic, stamp_ns):
            self._before_ns[topic] = max(stamp_ns, self._before_ns[topic])
            return self._epoch - 1
        self._newest_ns[topic] = max(stamp_ns, newest_ns)
        return self._epoch

    def _is_of_before(self, topic: str, stamp_ns: int) -> bool:
        """Whether a topic goes on where it was, though others have jumped back already."""
        if topic in self._newest_ns or topic not in self._before_ns:
            return False
        goes_on = stamp_ns >= self._before_ns[topic] - _LATE_NS
        return goes_on and stamp_ns > max(self._newest_ns.values()) + _LATE_NS
