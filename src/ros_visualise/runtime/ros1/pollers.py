"""The files by which rospy watches a topic's connections, closed as soon as nobody needs them."""

from __future__ import annotations

from rospy import topics


class _Poller(topics.Poller):  # type: ignore[misc]
    """Does not refer to itself: it goes with the topic that has it."""

    def __init__(self) -> None:
        super().__init__()
        for name in ("add_fd", "remove_fd", "error_iter"):
            delattr(self, name)

    add_fd = topics.Poller.add_epoll
    remove_fd = topics.Poller.remove_epoll
    error_iter = topics.Poller.error_epoll_iter


def mend_pollers() -> None:
    """Let the topics of this process that are left from now on leave no open file behind.

    A poller of rospy holds its own methods, so that only Python's collector ends it. In a process
    that has much else, as the page has, this comes hours later.
    """
    topics.Poller = _Poller
