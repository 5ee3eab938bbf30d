"""The camera node: a live source as messages."""

import pytest

from ros_visualise.core.errors import OpenError
from ros_visualise.nodes import SourceType, find
from ros_visualise.nodes.camera import CameraParams, CameraSource
from ros_visualise.sources.playback import Playback


def test_images_carry_the_time_of_now_and_the_frame() -> None:
    params = CameraParams(uri="test", size="64x48", fps=100, frame_id="front_optical")
    source = CameraSource(params, Playback(frames=3))
    messages = list(source.messages())
    source.close()
    assert [name for name, _ in messages] == ["image"] * 3
    assert {(m.width, m.height) for _, m in messages} == {(64, 48)}
    assert {m.header.frame_id for _, m in messages} == {"front_optical"}
    stamps = [m.header.stamp_ns for _, m in messages]
    assert stamps == sorted(set(stamps))


def test_images_carry_the_calibration_of_their_size(calibration: str) -> None:
    params = CameraParams(uri="test", size="64x48", fps=100, camera_info_url=calibration)
    source = CameraSource(params, Playback(frames=2))
    infos = [image.camera_info for _, image in source.messages()]
    source.close()
    assert [(i.width, i.height, i.K[0, 0]) for i in infos if i is not None] == 2 * [(64, 48, 40.0)]


def test_a_calibration_that_cannot_be_read_is_refused() -> None:
    with pytest.raises(OpenError, match="Is a directory"):
        CameraSource(CameraParams(uri="test", camera_info_url="."), Playback())


def test_a_closed_playback_ends_it() -> None:
    playback = Playback()
    source = CameraSource(CameraParams(uri="test"), playback)
    messages = source.messages()
    next(messages)
    playback.close()
    assert list(messages) == []
    source.close()


def test_no_such_camera_is_told() -> None:
    with pytest.raises(OpenError, match="no such device /dev/video63"):
        CameraSource(CameraParams(uri="63"), Playback())


def test_it_is_live() -> None:
    declared = find("camera")
    assert isinstance(declared, SourceType)
    assert declared.live
