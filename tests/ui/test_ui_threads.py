"""The threads behind the page: one job or round that fails costs neither the next nor a word."""

import sys
import threading
from typing import ClassVar

import pytest

from ros_visualise.core.supervision import PROCESS
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sources.recordings import TopicInfo
from ros_visualise.ui.live.curves import SampleStore
from ros_visualise.ui.live.sampling import RecordedCurves
from ros_visualise.ui.periodic import PeriodicThread
from ros_visualise.ui.worker import PageWorker

PATIENCE_S = 30.0


def failures():
    """(Who, how) -> how often; forgotten by that."""
    found = {failure[:2]: count for failure, count in PROCESS.failures.items()}
    PROCESS.forget()
    return found


def test_a_job_that_fails_is_counted_and_the_next_is_done():
    done = threading.Event()
    worker = PageWorker(print, lambda: None, 60.0)
    worker.post("bad", lambda: 1 / 0)
    worker.post("exit", sys.exit)
    worker.post("good", done.set)
    worker.start()
    assert done.wait(PATIENCE_S)
    worker.close(PATIENCE_S)
    assert failures() == {("page", "ZeroDivisionError"): 1, ("page", "SystemExit"): 1}


def test_a_round_that_fails_is_counted_and_the_next_is_done():
    done, finished = threading.Event(), threading.Event()
    counted = []

    def do_round():
        counted.append(1)
        if len(counted) < 3:
            raise ValueError
        done.set()

    rounds = PeriodicThread("drawing", do_round, finished.set, 0.0, lambda: False)
    rounds.start()
    assert done.wait(PATIENCE_S)
    rounds.close(PATIENCE_S)
    assert finished.is_set()
    assert failures() == {("drawing", "ValueError"): 2}


class Odd:
    """A recording that is read wrongly."""

    topics: ClassVar = {"/odd": TopicInfo(TopicType("std_msgs/msg/String"), 5)}

    def read(self, topics):
        raise KeyError("a bug")
        yield

    def close(self):
        pass


@pytest.mark.parametrize("at_opening", [True, False])
def test_a_recording_that_is_read_wrongly_is_no_curve_and_holds_up_nobody(at_opening):
    def open_it():
        if at_opening:
            raise KeyError("a bug")
        return Odd()

    decoding = RecordedCurves(open_it, None)
    curve = SampleStore(["x"], 0.0)
    assert decoding.first("/odd", PATIENCE_S) is None
    decoding.fill("/odd", curve)
    assert decoding.first("/odd", PATIENCE_S) is None
    decoding.close()
    assert curve.share == 1.0
    assert "a bug" in curve.error
    assert failures() == {("curves", "KeyError"): 3}
