"""What of a recording passes when it is begun in the middle, stepped through and sought."""

from pathlib import Path

import numpy as np

from ros_visualise.data import Header, Text
from ros_visualise.messages.qos import LATCHED, VOLATILE
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sources.playback import Playback
from ros_visualise.sources.recordings import Entry, Loss, TopicInfo
from ros_visualise.sources.recordings.playing import PlayableRecording

S = 10**9
START = 1_500_000_000 * S


class Made:
    """A recording in memory: (seconds, topic) of each message, whose text tells both."""

    path, format, size, compression, loss = Path("made"), "made", 0, "none", Loss()

    def __init__(self, entries, latched=()):
        self.entries = [
            Entry(topic, START + round(t * S), Text(f"{topic} {t:g}", Header(START)))
            for t, topic in entries
        ]
        self.start_ns, self.end_ns = self.entries[0].stamp_ns, self.entries[-1].stamp_ns
        names = sorted({topic for _, topic in entries})
        types = {"/tf": "tf2_msgs/msg/TFMessage", "/tf_static": "tf2_msgs/msg/TFMessage"}
        self.topics = {
            name: TopicInfo(
                TopicType(
                    types.get(name, "std_msgs/msg/String"),
                    qos=LATCHED if name in latched else VOLATILE,
                ),
                1,
            )
            for name in names
        }

    def read(self, start_ns=None, stop_ns=None, topics=None):
        for entry in self.entries:
            if start_ns is not None and entry.stamp_ns < start_ns:
                continue
            if stop_ns is not None and entry.stamp_ns >= stop_ns:
                return
            if topics is None or entry.topic in topics:
                yield entry

    def stamps_ns(self):
        return {
            name: np.array([e.stamp_ns for e in self.entries if e.topic == name], np.int64)
            for name in self.topics
        }

    def close(self):
        pass


def camera_and_imu(seconds=3):
    """Images at 10 Hz, an IMU at 100 Hz, transforms at both ends."""
    entries = [(0, "/tf_static"), (0, "/map")]
    entries += [(i / 10, "/image") for i in range(10 * seconds)]
    entries += [(i / 100, "/imu") for i in range(100 * seconds)]
    entries += [(i / 4, "/tf") for i in range(4 * seconds)]
    return Made(sorted(entries, key=lambda entry: entry[0]), latched=("/map",))


def texts(batch):
    return [entry.message.text for entry in batch]


def playable(recording, step="", topics=None):
    return PlayableRecording(recording, topics or recording.topics, lambda: step)


def test_from_the_start_every_message_passes_alone_in_order():
    recording = camera_and_imu()
    passed = list(playable(recording).read(0))
    assert [batch for _, batch in passed] == [(entry,) for entry in recording.entries]
    assert [t for t, _ in passed] == [e.stamp_ns - START for e in recording.entries]


def test_in_the_middle_one_sees_what_one_would_have_seen():
    time_ns, shown = next(playable(camera_and_imu(), "/image").read(round(2.004 * S)))
    assert time_ns == 2 * S
    assert texts(shown)[:2] == ["/tf_static 0", "/map 0"]
    assert texts(shown)[-1] == "/image 2"
    rest = sorted(texts(shown)[2:-1])
    assert rest == ["/imu 2", "/tf 1.25", "/tf 1.5", "/tf 1.75", "/tf 2"]


def test_what_follows_begins_after_that():
    reading = playable(camera_and_imu(), "/image").read(round(2.004 * S))
    next(reading)
    assert texts(next(reading)[1]) == ["/imu 2.01"]


def test_rare_topics_are_found_however_long_ago_they_came():
    recording = Made([(0, "/image"), *((i, "/imu") for i in range(100))])
    time_ns, shown = next(playable(recording, "/image").read(90 * S))
    assert (time_ns, texts(shown)) == (0, ["/imu 90", "/image 0"])


def test_where_nothing_has_come_yet_it_begins_with_what_comes():
    recording = Made([(0, "/imu"), (1, "/imu"), (5, "/image"), (6, "/image")])
    reading = playable(recording, topics=["/image"]).read(2 * S)
    assert texts(next(reading)[1]) == ["/image 5"]


def run(playback, recording, step):
    playback.step_topic = step
    source = PlayableRecording(recording, recording.topics, lambda: playback.step_topic)
    passed = []
    for _, batch in playback.run(source, source.is_frame):
        passed += texts(batch)
        yield passed


def test_so_many_frames_are_those_of_the_chosen_topic():
    *_, passed = run(Playback(rate=0, frames=3), camera_and_imu(), "/image")
    assert [text for text in passed if "image" in text] == ["/image 0", "/image 0.1", "/image 0.2"]
    assert passed[-1] == "/image 0.2"
    assert "/imu 0.19" in passed
    *_, passed = run(Playback(rate=0, frames=3), camera_and_imu(), "")
    assert len(passed) == 3


def test_a_step_passes_all_until_the_next_image():
    playback = Playback(rate=0)
    playing = run(playback, camera_and_imu(), "/image")
    passed = next(playing)
    while passed[-1] != "/image 0":
        next(playing)
    playback.step()
    while passed[-1] != "/image 0.1":
        next(playing)
    assert [text for text in passed if "image" in text] == ["/image 0", "/image 0.1"]
    playback.step()
    before = len(passed)
    while passed[-1] != "/image 0.2":
        next(playing)
    assert len(passed) - before == 11
    playback.step(-1)
    next(playing)
    assert passed[-1] == "/image 0.1"
    playback.close()


def test_over_again_it_is_the_same():
    recording = Made([(0, "/a"), (1, "/b"), (2, "/a")])
    playing = run(Playback(rate=0, loop=True, frames=7), recording, "")
    *_, passed = playing
    assert passed == ["/a 0", "/b 1", "/a 2", "/a 0", "/b 1", "/a 2", "/a 0"]


def test_a_stray_stamp_does_not_stretch_what_is_played():
    year_s = 365 * 86_400
    recording = Made([(-year_s, "/a"), *((i / 10, "/b") for i in range(20)), (year_s, "/a")])
    source = playable(recording)
    assert source.duration_ns == 2 * S + round(1.9 * S)
    times_ns = [time_ns for time_ns, _ in source.read(0)]
    assert times_ns == [0, *(S + i * S // 10 for i in range(20)), source.duration_ns]
    time_ns, shown = next(source.read(S + S // 2))
    assert (time_ns, texts(shown)[-1]) == (S + S // 2, "/b 0.5")
    reading = source.read(S // 2)
    assert [texts(next(reading)[1]) for _ in range(2)] == [["/a -3.1536e+07"], ["/b 0"]]
    assert [t for t, _ in playable(recording, topics=["/b"]).read(0)][:2] == [S, S + S // 10]
