"""Recordings and films on one line of time: order, names, alignment, offsets, failures."""

import json
from contextlib import closing
from datetime import datetime, timezone
from pathlib import Path

import av
import numpy as np
import pytest
from made_videos import numbered, write_video
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer

from ros_visualise.commands import main
from ros_visualise.data import Header, Transforms, TransformStamped
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import Recorded, TopicType, content
from ros_visualise.messages.restamped import restamped
from ros_visualise.nodes.player import player
from ros_visualise.sinks import open_recorder
from ros_visualise.sources.opening import open_again, open_joined
from ros_visualise.sources.playback import Playback
from ros_visualise.sources.recordings import joined as joined_module
from ros_visualise.sources.recordings.playing import PlayableRecording

ROS1 = Definitions("ros1").store
T = ROS1.types
S = 10**9
START_NS = 1_600_000_000 * S
BASE = Header(START_NS, "base")
PLACE = np.zeros(3), np.array([0, 0, 0, 1.0])


def header(stamp_ns, frame="base"):
    return T["std_msgs/msg/Header"](
        0, T["builtin_interfaces/msg/Time"](*divmod(stamp_ns, S)), frame
    )


def point(stamp_ns, x=0.0):
    place = T["geometry_msgs/msg/Point"](x, 0.0, 0.0)
    return T["geometry_msgs/msg/PointStamped"](header(stamp_ns), place)


def transforms(stamp_ns):
    move = T["geometry_msgs/msg/Transform"](
        T["geometry_msgs/msg/Vector3"](1, 2, 3), T["geometry_msgs/msg/Quaternion"](0, 0, 0, 1)
    )
    made = T["geometry_msgs/msg/TransformStamped"](header(stamp_ns, "odom"), "base", move)
    return T["tf2_msgs/msg/TFMessage"]([made])


KINDS = {
    "geometry_msgs/msg/PointStamped": point,
    "tf2_msgs/msg/TFMessage": transforms,
}


def write_bag(path, start_s, seconds=(0, 1, 2), **kinds):
    kinds = kinds or {"point": "geometry_msgs/msg/PointStamped"}
    with Writer(path) as bag:
        for name, kind in kinds.items():
            connection = bag.add_connection(f"/{name}", kind, typestore=ROS1)
            for second in seconds:
                stamp_ns = START_NS + round((start_s + second) * S)
                made = ROS1.serialize_ros1(KINDS[kind](stamp_ns), kind)
                bag.write(connection, stamp_ns, bytes(made))
    return path


def read(joined, **query):
    return [(entry.topic, (entry.stamp_ns - START_NS) / S) for entry in joined.read(**query)]


@pytest.fixture
def bags(tmp_path):
    return [write_bag(tmp_path / "a.bag", 0), write_bag(tmp_path / "b.bag", 0.5)]


def test_recordings_that_overlap_keep_their_stamps(bags):
    with closing(open_joined(bags)) as joined:
        whole = read(joined)
        later = read(joined, start_ns=START_NS + S, stop_ns=START_NS + 2 * S)
        only = read(joined, topics=["/b/point"])
        stamps = {topic: (found - START_NS).tolist() for topic, found in joined.stamps_ns().items()}
    order = [("/a/point", 0), ("/b/point", 0.5), ("/a/point", 1), ("/b/point", 1.5)]
    assert whole == [*order, ("/a/point", 2), ("/b/point", 2.5)]
    assert later == whole[2:4]
    assert only == whole[1::2]
    assert stamps == {"/a/point": [0, S, 2 * S], "/b/point": [S // 2, S + S // 2, 2 * S + S // 2]}


def test_others_begin_together_on_the_clock_of_the_first_with_a_date(tmp_path):
    film = write_video(tmp_path / "film.mkv", numbered(5))
    days = [write_bag(tmp_path / f"{day}.bag", 86400 * day) for day in (0, 3)]
    with closing(open_joined([film, *days])) as joined:
        assert joined.names == ["film", "source_0", "source_3"]
        assert joined.is_aligned == [False, True, False]
        entries = list(joined.read())
    assert {start for start, _ in joined.spans_ns} == {START_NS}
    stamps = [entry.stamp_ns for entry in entries]
    assert stamps == sorted(stamps)
    assert [entry.message.header.stamp_ns for entry in entries] == stamps
    assert "/image_raw" in joined.topics


def test_a_film_with_a_date_is_placed_by_it(tmp_path):
    made = datetime.fromtimestamp(START_NS / S + 1, timezone.utc)
    plain, film = write_video(tmp_path / "plain.mkv", numbered(10)), tmp_path / "film.mp4"
    with av.open(str(plain)) as source, av.open(str(film), "w") as target:
        target.metadata["creation_time"] = made.isoformat()
        stream = target.add_stream("mpeg4", rate=25)
        stream.width, stream.height, stream.pix_fmt = 32, 24, "yuv420p"
        for frame in source.decode(video=0):
            target.mux(stream.encode(frame.reformat(format="yuv420p")))
        target.mux(stream.encode())
    with closing(open_joined([film, write_bag(tmp_path / "a.bag", 0)])) as joined:
        assert joined.is_aligned == [True, True]
        assert joined.spans_ns[0][0] == START_NS + S


def test_an_offset_moves_every_stamp(bags, tmp_path):
    moving = write_bag(tmp_path / "c.bag", 0, tf="tf2_msgs/msg/TFMessage")
    with closing(open_joined([bags[0], moving])) as joined:
        joined.move([0, 0.25])
        found = {entry.topic: entry for entry in joined.read(stop_ns=START_NS + S)}
        again = open_again(joined)
    again.close()
    assert found["/tf"].stamp_ns == START_NS + S // 4
    inner = found["/tf"].message.content.transforms[0]
    assert inner.header.stamp_ns == START_NS + S // 4
    assert found["/point"].message.header.stamp_ns == START_NS
    assert joined.end_ns == START_NS + 2 * S + S // 4


@pytest.mark.parametrize("encoding", ["ros1", "cdr"])
def test_bytes_are_as_if_they_had_been_written_later(encoding):
    definitions = Definitions(encoding)
    types = definitions.types
    time = types["builtin_interfaces/msg/Time"](5, 900_000_000)
    number = (7,) if encoding == "ros1" else ()
    head = types["std_msgs/msg/Header"](*number, time, "map")
    place = types["geometry_msgs/msg/Point"](1.0, 2.0, 3.0)
    kind = "geometry_msgs/msg/PointStamped"
    data = bytes(definitions.write(kind, types[kind](head, place)))
    moved = restamped(Recorded(kind, data, definitions, 6 * S), S // 2)
    assert moved.header.stamp_ns == 6 * S + 400_000_000
    assert (moved.stamp_ns, moved.header.frame_id) == (6 * S + S // 2, "map")
    assert restamped(moved, -S // 2).data == data
    unstamped = types[kind](types["std_msgs/msg/Header"](*number, type(time)(0, 0), ""), place)
    none = Recorded(kind, bytes(definitions.write(kind, unstamped)), definitions, 6 * S)
    assert restamped(none, S).header.stamp_ns == 0
    first = Recorded(kind, none.data, definitions, 0)  # of a simulation
    assert restamped(first, S).header.stamp_ns == S


WITH_FRAMES = {"tf": "tf2_msgs/msg/TFMessage", "point": "geometry_msgs/msg/PointStamped"}


def frames_in(joined):
    found = {}
    for topic, _, message in joined.read():
        one = content(message) if topic == "/tf" else message
        links = one.transforms if topic == "/tf" else [one]
        for link in links:
            names = link.header.frame_id, getattr(link, "child_frame_id", "")
            found.setdefault(topic, set()).add(names)
    return found


@pytest.mark.parametrize("start_s", [0, 500])  # with the same stamps, and with moved ones
def test_frames_that_two_runs_move_get_names_of_their_own_in_one_map(tmp_path, start_s):
    starts = {"a": 0, "b": start_s, "c": 0}
    bags = [write_bag(tmp_path / f"{n}.bag", at, **WITH_FRAMES) for n, at in starts.items()]
    with closing(open_joined(bags)) as joined:
        assert list(joined.topics) == ["/a/point", "/b/point", "/c/point", "/tf"]
        assert frames_in(joined) == {
            "/tf": {("odom", "base"), ("odom", "b/base"), ("odom", "c/base")},
            "/a/point": {("base", "")},
            "/b/point": {("b/base", "")},
            "/c/point": {("c/base", "")},
        }
        assert len(joined.stamps_ns()["/tf"]) == len(read(joined, topics=["/tf"])) == 9


def test_frames_that_one_alone_moves_keep_their_names(tmp_path):
    bags = [write_bag(tmp_path / "a.bag", 0, tf="tf2_msgs/msg/TFMessage")]
    arm = Transforms((TransformStamped("arm", *PLACE, BASE),))
    with open_recorder(str(tmp_path / "b.mcap"), {"/tf": TopicType(Transforms.type_name)}) as b:
        b.write("/tf", arm, START_NS)
    with closing(open_joined([*bags, tmp_path / "b.mcap"])) as joined:
        assert frames_in(joined) == {"/tf": {("odom", "base"), ("base", "arm")}}


def test_plain_messages_get_other_frames_too():
    def rename(frame):
        return f"b/{frame}"

    moved = restamped(Transforms((TransformStamped("arm", *PLACE, BASE),)), S, rename)
    assert moved.transforms[0].child_frame_id == "b/arm"
    assert moved.header.frame_id == "b/base"
    assert moved.header.stamp_ns == START_NS + S


def test_one_that_fails_stops_no_other(bags, monkeypatch):
    with closing(open_joined(bags)) as joined:
        failing = joined._parts[0]

        def fail(*_, **__):
            yield from ()
            raise OSError("input/output error")

        monkeypatch.setattr(failing, "read", fail)
        assert read(joined) == [("/b/point", at) for at in (0.5, 1.5, 2.5)]
        assert joined.loss.notes == ["a.bag: ended early: input/output error"]


def test_names_are_valid_and_differ():
    names = joined_module.part_names
    assert names([Path("run 1.mcap"), Path("2024-05.bag")]) == ["run_1", "source_2024_05"]
    assert names([Path("a.mp4"), Path("a.ulg")]) == ["a_mp4", "a_ulg"]
    assert names([Path("x/a.bag"), Path("y/a.bag")]) == ["a_bag_1", "a_bag_2"]


def test_what_is_played_together_is_recorded_together(bags, tmp_path, capsys):
    """With an offset, by name or file name, and begun in the middle."""
    target = tmp_path / "out.bag"
    run = [*map(str, bags), "--view", "none", "--rate", "0", "--record", str(target), "--json"]
    assert main([*run, "--offset", "b.bag=-0.75", "--start", "1"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert set(report["topics"]) == {"/a/point", "/b/point"}
    with AnyReader([target]) as bag:
        written = [
            (one.topic, (stamp_ns - START_NS) / S, bag.deserialize(data, one.msgtype).header.stamp)
            for one, stamp_ns, data in bag.messages()
        ]
    assert [at for _, at, _ in written] == [0, 0.75, 1, 1.75, 2]
    assert [topic[1] for topic, *_ in written] == ["a", "b", "a", "b", "a"]
    assert (written[1][2].sec, written[1][2].nanosec) == (START_NS // S, 750_000_000)
    assert main(["view", *run[:4], "--rate", "0", "--frames", "1"]) == 0


@pytest.mark.parametrize("offset", ["c=1", "b=later", "b=nan", "b"])
def test_a_wrong_offset_is_wrong_usage(bags, offset, capsys):
    run = [*map(str, bags), "--view", "none", "--offset", offset]
    assert main(run) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) <= 3
    assert main([str(bags[0]), "--view", "none", "--offset", offset]) == 2


def test_bytes_of_images_are_equal_beside_their_stamps():
    definitions = Definitions("cdr")
    kind = "sensor_msgs/msg/Image"
    types = definitions.types
    head = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](1, 2), "c")
    image = types[kind](head, 1, 2, "mono8", 0, 2, np.array([3, 4], np.uint8))
    data = bytes(definitions.write(kind, image))
    moved = bytes(restamped(Recorded(kind, data, definitions, 0), 3).data)
    assert moved[:4] + moved[12:] == data[:4] + data[12:]
    assert definitions.read(kind, moved).header.stamp.nanosec == 5


@pytest.fixture
def film_and_bag(tmp_path):
    """A film of two seconds from 1.0 s on, in a bag of ten points."""
    film = write_video(tmp_path / "film.mkv", numbered(50))
    bag = write_bag(tmp_path / "long.bag", 0, range(10))
    with closing(open_joined([film, bag])) as joined:
        joined.move([1.0, 0])
        yield joined


@pytest.mark.parametrize(
    ("at_s", "image_s", "point_s"), [(0.5, None, 0), (1.5, 0.48, 1), (8.5, 1.96, 8)]
)
def test_a_seek_shows_what_each_source_has_then(film_and_bag, at_s, image_s, point_s):
    """Also before the film and after it, where steps go by the others."""
    playable = PlayableRecording(film_and_bag, [*film_and_bag.topics], lambda: "/image_raw")
    with closing(playable.read(round(at_s * S))) as batches:
        place_ns, shown = next(batches)
        next_ns, _ = next(batches)
    stamps = {entry.topic: (entry.stamp_ns - START_NS) / S for entry in shown}
    expected = {"/point": point_s} | ({} if image_s is None else {"/image_raw": 1 + image_s})
    assert stamps == pytest.approx(expected, abs=0.021)
    assert place_ns == shown[-1].stamp_ns - START_NS <= at_s * S < next_ns
    assert playable.is_frame(shown)


def test_the_key_images_of_the_only_film_are_previews(film_and_bag):
    source, playback = player(film_and_bag), Playback()
    source.make(source.params(film=1.0), playback)
    assert playback.key_image is not None
    place_ns, image = playback.key_image(2 * S)
    assert (place_ns / S, image.width) == (pytest.approx(2, abs=0.05), 32)
    assert playback.key_image(0)[0] == S


def test_a_change_of_the_speed_sends_no_message_again(bags):
    """On a graph, speed and pause are parameters of the player, beside the offsets."""
    sent = []
    with closing(open_joined(bags)) as joined:
        source, playback = player(joined, joined.topics), Playback(rate=0)
        made = source.make(source.params(), playback)
        for topic, _ in made.messages():
            sent.append(topic)
            made.configure(source.params(), {"rate", "paused"})
        assert len(sent) == len(read(joined))
