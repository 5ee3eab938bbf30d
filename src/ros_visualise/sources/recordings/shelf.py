"""What is kept in memory of pieces that are read in turns."""

from __future__ import annotations

from collections import OrderedDict
from typing import Protocol

_CAPACITY_BYTES = 96 << 20


class Keeper(Protocol):
    """Who keeps something on a `Shelf`."""

    def forget(self) -> None:
        """Let go of what it keeps; it can get it again."""


class Shelf:
    """Room for so many bytes; what was put there longest ago has to go first.

    Of one that is larger than all of it, there is room for that alone.
    """

    def __init__(self, capacity: int = _CAPACITY_BYTES) -> None:
        self._capacity = capacity
        self._sizes: OrderedDict[Keeper, int] = OrderedDict()
        self._users = 0

    @property
    def share(self) -> int:
        """The bytes that all who use it now could keep at the same time, each."""
        return self._capacity // max(1, self._users)

    def join(self) -> None:
        """One more uses it."""
        self._users += 1

    def leave(self, keeper: Keeper) -> None:
        """One less does."""
        self._users -= 1
        self._sizes.pop(keeper, None)
        keeper.forget()

    def keep(self, keeper: Keeper, size: int) -> None:
        """Somebody keeps so many bytes now, instead of what they kept before."""
        self._sizes.pop(keeper, None)
        self._sizes[keeper] = size
        while sum(self._sizes.values()) > self._capacity and len(self._sizes) > 1:
            oldest, _ = self._sizes.popitem(last=False)
            oldest.forget()
