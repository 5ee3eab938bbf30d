"""Limits on answers that are on their way to browsers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import contextmanager
from typing import NamedTuple

from ros_visualise.ui.server.answers import Refusal


class Client(NamedTuple):
    """The sender of a query: its address, and whether it is read-only."""

    address: str
    is_viewer: bool = False


class Share(NamedTuple):
    """Maximum number of answers at once, and of their bytes."""

    answers: int
    size: int


EACH, VIEWERS, ALL = Share(16, 128 << 20), Share(16, 256 << 20), Share(64, 384 << 20)


class Budget:
    """Counts the answers in progress, of each client, of all read-only ones, and of all.

    An answer that is larger than a share is sent alone. Calls come from the server's loop.
    """

    def __init__(self, each: Share = EACH, viewers: Share = VIEWERS, of_all: Share = ALL) -> None:
        self._each, self._viewers, self._all = each, viewers, of_all
        self._answers: Counter[Hashable] = Counter()
        self._sizes: Counter[Hashable] = Counter()

    @contextmanager
    def answer(self, client: Client) -> Iterator[Callable[[int], None]]:
        """Count an answer while it is made and sent; call the result with its size in bytes.

        Raises:
            Refusal: too many answers, or too many bytes, are in progress; also by that call.
        """
        shares = self._shares(client)
        if any(
            self._answers[who] >= most.answers or self._sizes[who] >= most.size
            for who, most in shares.items()
        ):
            raise _busy()
        held = 0

        def hold(size: int) -> None:
            nonlocal held
            if any(
                self._sizes[who] and self._sizes[who] + size > most.size
                for who, most in shares.items()
            ):
                raise _busy()
            held = size
            self._sizes.update(dict.fromkeys(shares, size))

        self._answers.update(shares.keys())
        try:
            yield hold
        finally:
            self._answers -= Counter(shares.keys())  # what is zero is forgotten
            self._sizes -= Counter(dict.fromkeys(shares, held))

    def _shares(self, client: Client) -> Mapping[Hashable, Share]:
        shares: dict[Hashable, Share] = {client: self._each, "all": self._all}
        return shares | {"viewers": self._viewers} if client.is_viewer else shares


def _busy() -> Refusal:
    return Refusal("busy: earlier answers are still being sent; try again", 503)
