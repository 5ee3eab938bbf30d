"""Thumbnails of the timeline."""

import cv2
import numpy as np
from made_videos import numbered, write_video
from waiting import wait_for

from ros_visualise.data import Header, Image
from ros_visualise.graph.pipelines import film_pipeline, image_pipeline, recording_pipeline
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sinks import open_recorder
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.playback import Playback
from ros_visualise.ui.live.thumbnails import Thumbnails


def started(graph):
    runtime = LocalRuntime(graph, Playback(hold=True))
    runtime.playback.pause()
    runtime.start()
    wait_for(lambda: runtime.playback.state.duration_s)
    return runtime


def value(jpeg):
    """Mean gray of a thumbnail."""
    pixels = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert max(pixels.shape) <= 160
    return pixels.mean()


def test_thumbnails_of_a_film_are_its_key_images(tmp_path):
    film = write_video(tmp_path / "film.mp4", numbered(40, 320, 240))
    runtime = started(film_pipeline(film))
    thumbnails = Thumbnails(runtime)
    try:
        assert value(thumbnails.at(1.0)) > 0
        assert thumbnails.at(99) == thumbnails.at(1.599)
    finally:
        thumbnails.close()
        runtime.stop()


def test_thumbnails_of_a_recording_are_made_once(tmp_path, monkeypatch):
    path = tmp_path / "images.mcap"
    with open_recorder(path, {"/camera": TopicType(Image.type_name)}, live=False) as recorder:
        for second in range(11):
            gray = np.full((120, 400), 20 * second, np.uint8)
            recorder.write("/camera", Image(gray, "mono8", Header((100 + second) * 10**9)))
    runtime = started(recording_pipeline(open_recording(path)))
    thumbnails = Thumbnails(runtime)
    try:
        found = [value(thumbnails.at(second)) for second in (0.0, 4.9, 9.2)]
        assert np.abs(np.subtract(found, [20, 100, 200])).max() < 3
        path.unlink()
        assert value(thumbnails.at(4.91)) == found[1]
    finally:
        thumbnails.close()
        runtime.stop()
    assert thumbnails.at(2.0) == b""


def test_a_source_that_is_drawn_has_none():
    runtime = started(image_pipeline("landscape"))
    try:
        assert Thumbnails(runtime).at(1.0) == b""
    finally:
        runtime.stop()
