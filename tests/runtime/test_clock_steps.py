"""A camera while somebody sets the clock: stamps follow, nothing is dropped, log times go on."""

import logging
import time

import numpy as np
import pytest
from waiting import wait_for

from ros_visualise.core.rate import Pacer, WallClock
from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources import camera
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.playback import Playback

FRAMES = 40
HOUR_NS = 3_600_000_000_000


class SetClock(WallClock):
    """The time of day, until somebody sets it."""

    set_by_ns = 0

    def now_ns(self):
        return time.time_ns() + self.set_by_ns


def read(path, topic):
    """(Log times, stamps) of a topic."""
    recording = open_recording(path)
    found = [(e.stamp_ns, e.message.header.stamp_ns) for e in recording.read(topics=[topic])]
    recording.close()
    return np.array(found).T


def dropped_without_steps(stamps_ns):
    """Images that fps_control drops, as some come late and many at once on a busy computer."""
    pacer = Pacer()
    return sum(not pacer.passes(stamp_ns, 30) for stamp_ns in stamps_ns)


@pytest.mark.parametrize("set_by_ns", [-HOUR_NS, -HOUR_NS // 720, HOUR_NS])
def test_a_clock_that_is_set_costs_no_frames(set_by_ns, monkeypatch, tmp_path, caplog):
    monkeypatch.setattr(camera, "WallClock", SetClock)
    monkeypatch.setattr(SetClock, "set_by_ns", 0)
    caplog.set_level(logging.INFO, "ros_visualise")
    graph = image_pipeline("camera", uri="test", size="64x48")
    runtime = LocalRuntime(graph, Playback(frames=FRAMES))
    runtime.start_recording(tmp_path / "out.mcap")
    runtime.start()
    wait_for(lambda: runtime.report().topics["/image_raw"].messages >= FRAMES // 2, "half of them")
    SetClock.set_by_ns = set_by_ns
    assert runtime.wait(60)
    runtime.stop()
    log_ns, stamps_ns = read(tmp_path / "out.mcap", "/image_raw")
    assert len(log_ns) == FRAMES
    assert (np.diff(log_ns) > 0).all()
    assert log_ns[-1] - log_ns[0] < HOUR_NS // 60
    [step] = np.flatnonzero(np.abs(np.diff(stamps_ns) - np.diff(log_ns)) > abs(set_by_ns) / 2)
    assert (np.delete(np.diff(stamps_ns), step) > 1000).all()
    stamps_ns[step + 1 :] -= set_by_ns
    dropped = runtime.report().nodes["fps_control"].dropped.get("rate", 0)
    assert dropped <= dropped_without_steps(stamps_ns) + 2
    way = f"{'ahead' if set_by_ns > 0 else 'back'} by {abs(set_by_ns) / 1e9:.1f} s"
    assert [r.getMessage() for r in caplog.records] == [f"camera test: the clock was set {way}"]
