"""Tracks in the format of the MOTChallenge."""

from pathlib import Path

import numpy as np
import pytest

from ros_visualise.commands import main
from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.data import Detection, Detections, Header, Hypothesis, Image
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import open_recorder

TOPICS = {
    "/image_raw": TopicType(Image.type_name),
    "/detections": TopicType(Detections.type_name),
    "/tracks": TopicType(Detections.type_name),
}


def tracks(number, *ids):
    several = [
        Detection(np.array([20.0 + n, 40]), np.array([10.0, 20]), 0, (Hypothesis("car", 0.75),), id)
        for n, id in enumerate(ids)
    ]
    return Detections(tuple(several), Header(number * 40_000_000, "camera"))


def test_rows_of_frames(tmp_path: Path) -> None:
    path = tmp_path / "tracks.txt"
    with open_recorder(path, TOPICS) as recorder:
        assert recorder.topics == ("/tracks",)
        recorder.write("/tracks", tracks(0))
        recorder.write("/tracks", tracks(1, "7", ""))
        recorder.write("/detections", tracks(1, "8"))
        recorder.write("/tracks", tracks(2, "a4-b", "c"))
        recorder.write("/tracks", tracks(3, "c"))
        recorder.write("/tracks", Detections((Detection(np.full(2, np.nan), np.ones(2)),)))
    assert path.read_text().splitlines() == [
        "2,7,16.00,31.00,10.00,20.00,0.75,-1,-1,-1",
        "2,-1,17.00,31.00,10.00,20.00,0.75,-1,-1,-1",
        "3,1,16.00,31.00,10.00,20.00,0.75,-1,-1,-1",
        "3,2,17.00,31.00,10.00,20.00,0.75,-1,-1,-1",
        "4,2,16.00,31.00,10.00,20.00,0.75,-1,-1,-1",
    ]
    with pytest.raises(OpenError, match="exists"):
        open_recorder(path, TOPICS)


def test_a_recording_is_converted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recording, path = tmp_path / "r.mcap", tmp_path / "t.txt"
    with open_recorder(recording, TOPICS) as recorder:
        for number in range(3):
            recorder.write("/tracks", tracks(number, "5"))
    assert main(["convert", str(recording), str(path), "--topics", "/tracks"]) == 0
    assert [row.split(",")[:2] for row in path.read_text().splitlines()] == [
        ["1", "5"],
        ["2", "5"],
        ["3", "5"],
    ]


def test_only_one_topic_of_detections(tmp_path: Path) -> None:
    path = tmp_path / "t.txt"
    with pytest.raises(UsageError, match="can store only one topic with tracks"):
        open_recorder(path, TOPICS, named=["/image_raw"])
    with pytest.raises(UsageError, match="no topic with tracks or detections"):
        open_recorder(path, {"/image_raw": TOPICS["/image_raw"]})
    assert not path.exists()
