"""Search over the texts of messages, recorded and live."""

import numpy as np
import pytest
from scene_messages import odometry
from scene_runtime import Told
from waiting import wait_for

from ros_visualise.data import DiagnosticArray, DiagnosticStatus, Header, Image, Odometry, Text
from ros_visualise.data.reports import Level
from ros_visualise.graph.pipelines import recording_pipeline
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sinks import open_recorder
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.playback import Playback
from ros_visualise.ui.live.rewinding import Rewinder
from ros_visualise.ui.live.texts import LiveTexts, RecordedTexts

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


@pytest.fixture
def live():
    told = Told(said=Text, camera=Image, odom=Odometry)
    told.add("/diagnostics", DiagnosticArray)
    rewinder = Rewinder(told, lambda: True)
    wait_for(lambda: told.asked["/said"] and told.asked["/diagnostics"], "the topics with texts")
    yield told, rewinder
    rewinder.close()


def kept_count(rewinder):
    return len(rewinder.buffer.since(0, 100)[1])


def test_texts_of_a_live_graph_are_found_while_they_are_kept(live):
    told, rewinder = live
    found = LiveTexts(rewinder)
    for number, words in enumerate(("Take off", "LAND now", "LAND now", "Landed")):
        told.say(said=Text(words, Header(number)))
        wait_for(lambda: kept_count(rewinder) == number + 1)  # noqa: B023
    told.say(diagnostics=DiagnosticArray((WARNING,), Header(9)))
    wait_for(lambda: kept_count(rewinder) == 5)
    assert not told.asked["/camera"]
    assert not told.asked["/odom"]
    answer = found.find("land")
    assert [one[1:] for one in answer["found"]] == [("/said", "LAND now"), ("/said", "Landed")]
    assert answer["share"] == 1.0
    ((to_s, *_),) = found.find("take")["found"]
    rewinder.seek(to_s, paused=True)
    shown = rewinder.subscribe("/said", 10)
    assert shown.take(60).text == "Take off"
    assert found.find("battery")["count"] == 1
    rewinder.buffer.add(10**15, "/odom", odometry([0, 0, 0], 1))
    assert found.find("land")["count"] == 0
