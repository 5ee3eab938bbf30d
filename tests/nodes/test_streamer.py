"""The streamer: a video file as messages."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_videos import numbered, write_video

from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.core.params import specs
from ros_visualise.nodes import find
from ros_visualise.nodes.streamer import Streamer, StreamerParams
from ros_visualise.sources.playback import Playback


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
    with pytest.raises(OpenError, match="give a video file"):
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
    restart = {s.name for s in specs(StreamerParams) if s.restart}
    assert restart == {"path", "size", "frame_id", "camera_info_url"}


def test_images_carry_the_calibration_of_their_size(path: str, calibration: str) -> None:
    params = StreamerParams(path=path, camera_info_url=calibration)
    for size, focal_length in (("", 20.0), ("8x6", 5.0)):
        streamer = Streamer(replace(params, size=size), Playback(rate=0))
        for _, image in streamer.messages():
            info = image.camera_info
            assert info is not None
            assert (info.width, info.height) == (image.width, image.height)
            assert info.K[0, 0] == pytest.approx(focal_length)


def test_without_a_calibration_they_carry_none(path: str) -> None:
    streamer = Streamer(StreamerParams(path=path), Playback(rate=0))
    assert all(image.camera_info is None for _, image in streamer.messages())


def test_a_calibration_of_another_shape_is_refused(path: str, calibration: str) -> None:
    params = StreamerParams(path=path, camera_info_url=calibration, size="8x8")
    with pytest.raises(OpenError, match="images of 8x8 have a different aspect ratio"):
        Streamer(params, Playback())
    with pytest.raises(OpenError, match="Is a directory"):
        Streamer(replace(params, camera_info_url="."), Playback())
