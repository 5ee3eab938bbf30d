"""Previews while a person seeks: key images, until the exact image comes."""

import numpy as np
import pytest
from waiting import wait_for

from ros_visualise.data import Image
from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.sources.playback import Playback
from ros_visualise.ui.live import previews
from ros_visualise.ui.live.previews import Previews, shows_source

S = 1_000_000_000
IMAGE = Image(np.zeros((2, 2), np.uint8), "mono8")


class Frames:
    """A message each second."""

    duration_ns = 20 * S

    def read(self, start_ns):
        for second in range(start_ns // S, 20):
            yield second * S, second


@pytest.fixture
def shown(monkeypatch):
    monkeypatch.setattr(previews, "_GRACE_S", 0.0)
    return []


def follow(playback, shown, asked, is_wanted=lambda: True, find=None):
    def find_key(time_ns):
        asked.append(time_ns / S)
        return time_ns // (5 * S) * 5 * S, IMAGE

    playback.key_image = find or find_key
    return Previews(playback, lambda image: shown.append(image.header.stamp_ns / S), is_wanted)


def test_the_key_image_is_shown_where_it_is_nearer_than_the_present_one(shown):
    playback, asked = Playback(start_s=11.0), []
    previews = follow(playback, shown, asked)
    playback.seek(6)
    wait_for(lambda: shown == [5])
    playback.seek(7)  # 5 is shown already
    wait_for(lambda: 7 in asked)
    playback.seek(17)
    wait_for(lambda: shown == [5, 15])
    playback.seek(19)
    wait_for(lambda: 19 in asked)
    playback.seek(12)  # 15 is shown, 10 is nearer
    wait_for(lambda: shown == [5, 15, 10])
    previews.close()
    playback.close()


def test_a_seek_shows_images_on_the_way_until_the_exact_one(shown, monkeypatch):
    monkeypatch.setattr(previews, "_AGAIN_S", 0.001)
    monkeypatch.setattr(previews, "_LATE_S", 0.0)
    playback, images = Playback(start_s=10.0), [(0, IMAGE)]
    following = follow(playback, shown, [], find=lambda _: images[-1])
    playback.seek(9)  # 0 is farther than 10, but on the way
    for second in (0, 3, 5, 8):
        images.append((second * S, IMAGE))
        wait_for(lambda second=second: shown[-1:] == [second])
    assert shown == [0, 3, 5, 8]
    following.close()
    playback.close()


def test_none_is_made_once_the_exact_image_has_come_or_while_nobody_looks(shown):
    playback, asked = Playback(hold=True), []
    playback.pause()
    playing = playback.run(Frames())
    next(playing)
    playback.seek(6)
    assert next(playing)[1] == 6
    is_wanted = [True]
    previews = follow(playback, shown, asked, lambda: is_wanted[0])
    playback.seek(7)
    wait_for(lambda: {*asked} == {7})  # of the seek before, nothing
    is_wanted[0] = False
    playback.seek(16)
    assert next(playing)[1] == 16
    playback.seek(3)
    playback.seek(4)
    is_wanted[0] = True
    playback.seek(1)
    wait_for(lambda: asked[-1] == 1)
    assert 16 not in asked
    previews.close()
    playback.close()


def test_previews_stand_for_images_that_are_the_sources_own():
    graph = image_pipeline("landscape")
    assert shows_source(graph) == {"/image_raw", "/controlled_stream"}


def test_what_is_outdated_is_read_for_a_moment_where_nothing_was_shown_for_long():
    clock_s = [0.0]
    playback = Playback(hold=True, clock=FakeClock(clock_s))
    playback.pause()
    playing = playback.run(Frames())
    next(playing)
    playback.seek(6)
    assert playback.is_outdated
    clock_s[0] += 0.5
    assert not playback.is_outdated
    clock_s[0] += 1.0  # it takes so long that no other seek may wait for it
    assert playback.is_outdated
    assert next(playing)[1] == 6
    assert not playback.is_outdated
    playback.close()


class FakeClock:
    """Time that a test sets; a wait ends at once."""

    def __init__(self, now_s):
        self._now_s = now_s

    def monotonic_ns(self):
        return round(self._now_s[0] * 1e9)

    def now_ns(self):
        return 1_600_000_000 * 10**9 + self.monotonic_ns()

    def wait(self, changed, until_ns):
        changed.wait(0.001)
