"""What `convert` carries over beside messages; what the new file cannot store is said."""

import json
from pathlib import Path
from typing import Any

import pytest
from made_mcaps import STRING, latched_qos, numbered, text, write_bag
from mcap.reader import make_reader
from mcap.records import Attachment, Metadata
from mcap.writer import Writer
from rosbags.interfaces import QosReliability
from rosbags.rosbag1 import Reader as BagReader
from rosbags.rosbag2 import Reader as FolderReader
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2.metadata import dump_qos_v8, dump_qos_v9
from rosbags.typesys import Stores, get_typestore
from ruamel.yaml import YAML

from ros_visualise.commands import main
from ros_visualise.data import Header, Text
from ros_visualise.messages.qos import LATCHED, QoS
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import open_recorder

NOTES = Attachment(7, 5, "notes.txt", "text/plain", b"calm, sunny")
PICTURE = Attachment(8, 6, "site.png", "image/png", bytes(range(256)))
PLACE = Metadata("place", {"name": "north field", "marker": "7"})
BEST_EFFORT = latched_qos()._replace(reliability=QosReliability.BEST_EFFORT)
QOS = dump_qos_v8([BEST_EFFORT])
LABELS = {"unit": "m/s", "sensor": "front"}
TIMES = [(1000 * n + 1000, 1000 * n + 970, n + 40) for n in range(5)]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """An MCAP file with attachments, metadata and QoS, messages of which were sent before."""
    path = tmp_path / "run.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        schema = writer.register_schema(STRING, "ros2msg", b"string data")
        channel = writer.register_channel(
            "/a", "cdr", schema, {"offered_qos_profiles": QOS, **LABELS}
        )
        writer.add_attachment(NOTES.create_time, NOTES.log_time, *_of(NOTES))
        for log_ns, sent_ns, number in TIMES:
            writer.add_message(channel, log_ns, text("x"), sent_ns, number)
        writer.add_attachment(PICTURE.create_time, PICTURE.log_time, *_of(PICTURE))
        writer.add_metadata(PLACE.name, PLACE.metadata)
        writer.finish()
    return path


def _of(attachment: Attachment) -> tuple[str, str, bytes]:
    return attachment.name, attachment.media_type, attachment.data


def convert(source: Path, target: Path, *options: str) -> Path:
    assert main(["convert", str(source), str(target), *options]) == 0
    return target


def held(path: Path) -> dict[str, Any]:
    """What the mcap library finds by a file's index."""
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        found = list(reader.iter_messages())
        summary = reader.get_summary()
        assert summary is not None
        statistics = summary.statistics
        assert statistics is not None
        return {
            "attachments": list(reader.iter_attachments()),
            "metadata": list(reader.iter_metadata()),
            "times": [(m.log_time, m.publish_time, m.sequence) for _, _, m in found],
            "channels": {channel.topic: channel.metadata for _, channel, _ in found},
            "counted": (statistics.attachment_count, statistics.metadata_count),
        }


EXPECTED = {
    "attachments": [NOTES, PICTURE],
    "metadata": [PLACE],
    "times": TIMES,
    "channels": {"/a": {"offered_qos_profiles": QOS, **LABELS}},
    "counted": (2, 1),
}


def test_an_mcap_keeps_all(path: Path, capsys) -> None:
    assert held(convert(path, path.with_name("copy.mcap"))) == EXPECTED
    assert "no place" not in capsys.readouterr().err


def test_a_folder_keeps_all_and_its_metadata_tell_the_qos(path: Path) -> None:
    folder = convert(path, path.with_name("folder"))
    assert held(folder / "folder_0.mcap") == EXPECTED
    with FolderReader(folder) as reader:
        (connection,) = reader.connections
    assert connection.ext.offered_qos_profiles == [BEST_EFFORT]
    assert held(convert(folder, path.with_name("back.mcap"))) == EXPECTED


def test_a_bag_keeps_the_latching_and_the_rest_is_said_once(path: Path, capsys) -> None:
    bag = convert(path, path.with_name("r.bag"), "--json")
    out, err = capsys.readouterr()
    unplaced = {
        "QoS profile": 1,
        "topic label": 2,
        "attachment": 2,
        "metadata record": 1,
        "sequence number": 5,
        "sending time": 5,
    }
    assert json.loads(out)["unplaced"] == unplaced
    (line,) = [line for line in err.splitlines() if "cannot store" in line]
    assert line == (
        f"ros-visualise: {bag} cannot store 1 QoS profile, 2 topic labels, 2 attachments,"
        " 1 metadata record, 5 sequence numbers, 5 sending times"
    )
    with BagReader(bag) as reader:
        (connection,) = reader.connections
        assert connection.ext.latching
        assert reader.message_count == 5


def test_words_for_qos_become_numbers_where_those_are_read(tmp_path: Path) -> None:
    words = YAML(typ="safe")
    with (tmp_path / "qos.yaml").open("w") as file:
        words.dump(dump_qos_v9([BEST_EFFORT]), file)
    source = tmp_path / "run.mcap"
    with source.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        schema = writer.register_schema(STRING, "ros2msg", b"string data")
        profiles = (tmp_path / "qos.yaml").read_text()
        channel = writer.register_channel("/a", "cdr", schema, {"offered_qos_profiles": profiles})
        writer.add_message(channel, 5, text("x"), 5)
        writer.finish()
    folder = convert(source, tmp_path / "folder")
    kept = held(folder / "folder_0.mcap")["channels"]["/a"]["offered_qos_profiles"]
    assert kept == profiles.strip()
    about = YAML(typ="safe").load(folder / "metadata.yaml")["rosbag2_bagfile_information"]
    (topic,) = about["topics_with_message_count"]
    assert topic["topic_metadata"]["offered_qos_profiles"] == QOS


def test_texts_that_people_gave_a_folder_stay_where_ros_has_them(tmp_path: Path) -> None:
    bag, yaml = tmp_path / "bag", YAML(typ="safe")
    write_bag(bag, numbered(range(3)), StoragePlugin.SQLITE3)
    about = yaml.load(bag / "metadata.yaml")
    about["rosbag2_bagfile_information"]["custom_data"] = {"pilot": "Ann", "place": "north field"}
    yaml.dump(about, bag / "metadata.yaml")
    folder = convert(bag, tmp_path / "folder")
    kept = yaml.load(folder / "metadata.yaml")["rosbag2_bagfile_information"]["custom_data"]
    assert kept == {"pilot": "Ann", "place": "north field"}
    assert held(folder / "folder_0.mcap")["metadata"] == []
    back = convert(convert(folder, tmp_path / "file.mcap"), tmp_path / "again")
    assert yaml.load(back / "metadata.yaml")["rosbag2_bagfile_information"]["custom_data"] == kept


@pytest.mark.parametrize("storage", StoragePlugin)
def test_a_ros2_folder_hands_its_qos_on(tmp_path: Path, storage: StoragePlugin) -> None:
    write_bag(tmp_path / "bag", numbered(range(1, 7)), storage, latched=["/b"])
    with FolderReader(convert(tmp_path / "bag", tmp_path / "folder")) as reader:
        offered = {c.topic: c.ext.offered_qos_profiles for c in reader.connections}
    assert offered == {"/a": [], "/b": [latched_qos()], "/c": []}


def write_ros1(path: Path, publishers: dict[str, list[str]]) -> Path:
    """An MCAP file of ROS 1 with one message of each publisher of each topic."""
    store = get_typestore(Stores.ROS1_NOETIC)
    data = bytes(store.serialize_ros1(store.types[STRING](data="x"), STRING))
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros1")
        schema = writer.register_schema("std_msgs/String", "ros1msg", b"string data")
        for topic, names in publishers.items():
            for name in names:
                about = {"callerid": name, "latching": "1"}
                writer.add_message(
                    writer.register_channel(topic, "ros1", schema, about), 5, data, 5
                )
        writer.finish()
    return path


def connections(path: Path) -> dict[str, tuple[str, int]]:
    with BagReader(path) as reader:
        return {c.topic: (c.ext.callerid, c.ext.latching) for c in reader.connections}


@pytest.mark.parametrize("profile", ["ros1", "ros2"])
def test_ros1_publishers_and_latching_go_around(tmp_path: Path, profile: str, capsys) -> None:
    source = write_ros1(tmp_path / "a.mcap", {"/a": ["/talker"]})
    mcap = convert(source, tmp_path / "r.mcap", "--profile", profile)
    assert held(mcap)["channels"]["/a"]["callerid"] == "/talker"
    assert connections(convert(mcap, tmp_path / "back.bag")) == {"/a": ("/talker", 1)}
    assert "no place" not in capsys.readouterr().err


def test_publishers_that_became_one_are_said(tmp_path: Path, capsys) -> None:
    source = write_ros1(tmp_path / "a.mcap", {"/a": ["/one", "/two"], "/b": ["/one"]})
    target = convert(source, tmp_path / "r.bag")
    assert connections(target) == {"/a": ("/ros_visualise", 1), "/b": ("/one", 1)}
    said = f"ros-visualise: {target} cannot store 2 publisher names"
    assert said in capsys.readouterr().err.splitlines()


def test_what_is_recorded_tells_how_it_is_offered(tmp_path: Path) -> None:
    topics = {
        "/map": TopicType(STRING, qos=LATCHED),
        "/scan": TopicType(STRING, qos=QoS(reliable=False)),
        "/odom": TopicType(STRING),
    }
    with open_recorder(f"{tmp_path}/run", topics) as recorder:
        for topic in topics:
            recorder.write(topic, Text("x", Header(5)))
    with FolderReader(tmp_path / "run") as reader:
        offered = {c.topic: c.ext.offered_qos_profiles for c in reader.connections}
    (latched,), (scan,) = offered["/map"], offered["/scan"]
    assert (latched.durability.name, latched.depth) == ("TRANSIENT_LOCAL", 1)
    assert (scan.durability.name, scan.reliability.name) == ("VOLATILE", "BEST_EFFORT")
    assert offered["/odom"] == []
