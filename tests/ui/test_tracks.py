"""The whole tracks of a recording, faintly drawn."""

import numpy as np
import pytest
from made_videos import numbered, write_video

from ros_visualise.data import Header, NavSatFix, Odometry, PoseStamped
from ros_visualise.graph.pipelines import film_pipeline, recording_pipeline
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sinks import open_recorder
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.playback import Playback
from ros_visualise.ui.live.space.shown import ShownScene
from ros_visualise.ui.scene import tracks
from ros_visualise.ui.scene.tracks import whole_tracks

ODOM, FIX, POSE = "/odom", "/fix", "/pose"
TYPES = {ODOM: Odometry, FIX: NavSatFix, POSE: PoseStamped}
LEVEL = np.array([0.0, 0, 0, 1])


@pytest.fixture
def runtime(tmp_path):
    path = tmp_path / "drive.mcap"
    topics = {name: TopicType(kind.type_name) for name, kind in TYPES.items()}
    with open_recorder(path, topics, live=False) as recorder:
        for n in range(30):
            header = Header((100 + n) * 10**9, "odom")
            xyz = np.array([n, n % 2, 0.0])
            odometry = Odometry(xyz, LEVEL, child_frame_id="base", header=header)
            recorder.write(ODOM, odometry)
            status = -1 if n == 5 else 0
            recorder.write(FIX, NavSatFix(50 + n * 1e-5, 8.0, np.nan, status=status, header=header))
            if n == 3:
                recorder.write(POSE, PoseStamped(xyz, LEVEL, header))
    playback = Playback(hold=True)
    playback.pause()
    found = LocalRuntime(recording_pipeline(open_recording(path)), playback)
    found.start()
    yield found
    found.stop()


@pytest.mark.parametrize("largest", [tracks._READ_BYTES, 0])
def test_tracks_are_read_whole_or_in_samples(runtime, monkeypatch, largest):
    monkeypatch.setattr(tracks, "_READ_BYTES", largest)
    found = dict(whole_tracks(runtime, lambda: False))
    assert found.keys() == {ODOM, FIX}, "one pose is no way"
    assert np.array_equal(found[ODOM], [[n, n % 2, 0] for n in range(30)])
    assert len(found[FIX]) == 29
    assert found[FIX][-1].tolist() == pytest.approx([50.00029, 8, 0])


def test_the_fixes_of_a_film(tmp_path):
    film = write_video(tmp_path / "film.mp4", numbered(5))
    block = "{n}\n00:00:0{n},000 --> 00:00:0{n},900\nGPS(8.000{n},50.0,16) BAROMETER:1.9\n\n"
    (tmp_path / "film.SRT").write_text("".join(block.format(n=n) for n in range(1, 5)))
    runtime = LocalRuntime(film_pipeline(film), Playback())
    try:
        assert [(topic, len(track)) for topic, track in whole_tracks(runtime, lambda: False)] == [
            ("/fix", 4)
        ]
    finally:
        runtime.stop()


def test_it_ends_when_asked(runtime):
    assert not dict(whole_tracks(runtime, lambda: True))


def test_the_whole_way_is_drawn_before_it_is_played(runtime, tree, look):
    shown = ShownScene(runtime, tree, "", lambda: True, pytest.fail, lambda state: None)
    odom, fix = "topics/odom/whole", "topics/fix/whole"
    try:
        assert look(odom, lambda node: len(node["points"]) == 29)["points"][-1, 1, 0] == 29
        shown.scene.set_visible(FIX, True)
        runtime.playback.step()
        look(fix, lambda node: len(node["points"]) == 28 and abs(node["points"][0, 0, 1]) < 0.1)
        runtime.playback.seek(20)  # where the plane through the first fix begins anew
        look(fix, lambda node: abs(node["points"][0, 0, 1] + 20 * 1.112) < 0.1)
        assert look(odom)["points"][-1, 1, 0] == 29
    finally:
        shown.close(1)
