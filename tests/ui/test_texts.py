"""Search over the texts of a recording's messages."""

import numpy as np
import pytest
from scene_messages import odometry
from waiting import wait_for

from ros_visualise.data import DiagnosticArray, DiagnosticStatus, Header, Image, Odometry, Text
from ros_visualise.data.reports import Level
from ros_visualise.graph.pipelines import recording_pipeline
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sinks import open_recorder
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.playback import Playback
from ros_visualise.ui.live.texts import RecordedTexts

KINDS = {"/said": Text, "/diagnostics": DiagnosticArray, "/odom": Odometry, "/camera": Image}
WARNING = DiagnosticStatus("battery", Level.WARN, "cell 3 is low", values={"cell 3": "3.1 V"})


@pytest.fixture
def texts(tmp_path):
    path = tmp_path / "said.mcap"
    topics = {topic: TopicType(kind.type_name) for topic, kind in KINDS.items()}
    with open_recorder(path, topics, live=False) as recorder:
        for second in range(60):
            header = Header((1000 + second) * 10**9)
            statuses = (WARNING,) if second >= 40 else ()
            recorder.write("/diagnostics", DiagnosticArray(statuses, header))
            recorder.write("/said", Text("Take off" if second < 7 else "LAND now", header))
            recorder.write("/odom", odometry([second, 0, 0], 1000 + second))
            recorder.write("/camera", Image(np.zeros((4, 4), np.uint8), "mono8", header))
    runtime = LocalRuntime(recording_pipeline(open_recording(path)), Playback(hold=True))
    runtime.playback.pause()
    runtime.start()
    found = RecordedTexts(runtime)
    wait_for(lambda: found.find("x")["share"] == 1.0, "the texts")
    yield found
    found.close()
    runtime.stop()


@pytest.mark.parametrize(
    ("words", "found"),
    [
        ("land", [(7.0, "/said", "LAND now")]),
        ("now LAND", [(7.0, "/said", "LAND now")]),
        ("3.1 battery", [(40.0, "/diagnostics", "battery cell 3 is low cell 3 3.1 V")]),
        ("take land", []),
        ("mono8", []),
        ("base_link", []),
        ("", []),
    ],
)
def test_texts_are_found_by_all_words_where_they_begin(texts, words, found):
    answer = texts.find(words)
    places = [(place_s, topic, text) for place_s, topic, text in answer["found"]]
    assert (places, answer["count"]) == (found, len(found))
