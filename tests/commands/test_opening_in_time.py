"""What is opened from the page may take a while, and nobody need wait for it."""

from __future__ import annotations

from pathlib import Path
from threading import Event

import pytest

from ros_visualise.core.errors import OpenError
from ros_visualise.core.signals import StopRequest
from ros_visualise.running.interruptible import opened_within

PATH, LONG_S = Path("x.bag"), 1e6


def test_what_is_opened_is_given():
    assert opened_within(PATH, LONG_S, StopRequest(), lambda: 5, pytest.fail) == 5
    with pytest.raises(ZeroDivisionError):
        opened_within(PATH, LONG_S, StopRequest(), lambda: 1 // 0, pytest.fail)


@pytest.mark.parametrize("asked", [True, False], ids=["asked to end", "too long"])
def test_what_comes_too_late_is_closed(asked: bool):
    request, come, closed = StopRequest(), Event(), Event()
    request.asked = asked

    def late() -> Event:
        come.wait()
        return closed

    if asked:
        assert opened_within(PATH, LONG_S, request, late, Event.set) is None
    else:
        with pytest.raises(OpenError, match=r"^x.bag: not opened within 0 s"):
            opened_within(PATH, 0, request, late, Event.set)
    assert not closed.is_set()
    come.set()
    assert closed.wait(60)
