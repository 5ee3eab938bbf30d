"""The streamer: a video file as messages."""

import sys
from pathlib import Path

import numpy as np
import pytest

from ros_visualise.errors import OpenError, UsageError
from ros_visualise.nodes import find
from ros_visualise.nodes.streamer import Streamer, StreamerParams
from ros_visualise.params import specs
from ros_visualise.sources.playback import Playback

sys.path.append(str(Path(__file__).parents[1] / "sources"))
from made_videos import numbered, write_video


@pytest.fixture
def path(tmp_path: Path) -> str:
    return str(write_video(tmp_path / "v.mkv", numbered(4)))


def test_images_carry_their_times_and_frame(path: str) -> None:
    params = StreamerParams(path=path, frame_id="front_optical")
    messages = list(Streamer(params, Playback(rate=0)).messages())
    assert [name for name, _ in messages] == ["image"] * 4
    assert [m.header.stamp_ns for _, m in messages] == [40_000_000 * n for n in range(4)]
    assert {m.header.frame_id for _, m in messages} == {"front_optical"}
    assert np.array_equal(messages[3][1].pixels, numbered(4)[3])


def test_a_size_is_scaled_to(path: str) -> None:
    streamer = Streamer(StreamerParams(path=path, size="8x6"), Playback(rate=0))
    assert {(m.width, m.height) for _, m in streamer.messages()} == {(8, 6)}


def test_what_it_cannot_play_is_refused(path: str) -> None:
    with pytest.raises(OpenError, match="path=FILE"):
        Streamer(StreamerParams(), Playback())
    with pytest.raises(OpenError, match="no such file"):
        Streamer(StreamerParams(path="nothing.mp4"), Playback())
    with pytest.raises(UsageError, match="such as 640x480"):
        Streamer(StreamerParams(path=path, size="big"), Playback())


def test_close_ends_the_messages(path: str) -> None:
    playback = Playback(rate=0, loop=True)
    streamer = Streamer(StreamerParams(path=path), playback)
    messages = streamer.messages()
    next(messages)
    playback.close()
    streamer.close()
    assert list(messages) == []


def test_file_and_size_reopen_it() -> None:
    assert find("streamer").params is StreamerParams
    assert {s.name for s in specs(StreamerParams) if s.restart} == {"path", "size", "frame_id"}
