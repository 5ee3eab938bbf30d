"""A part of a recording or a film that a browser exports, read by other tools."""

import csv

import av
import pytest
from made_videos import numbered, write_video
from mcap.reader import make_reader
from page_client import VIEW_TOKEN, Live, get
from rosbags.highlevel import AnyReader
from scene_messages import odometry

from ros_visualise.commands import main
from ros_visualise.data import Imu, Odometry
from ros_visualise.data.header import Header
from ros_visualise.graph.pipelines import film_pipeline, recording_pipeline
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sinks import open_recorder
from ros_visualise.sources.opening import open_joined, open_recording
from ros_visualise.sources.playback import Playback
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.live import exporter
from ros_visualise.ui.live.marks import Marks
from ros_visualise.ui.page import Page
from ros_visualise.ui.server.answers import HEADER

START_S = 1_600_000_000
S = 10**9


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Ten seconds of /odom, ten in a second, and of /imu."""
    path = tmp_path_factory.mktemp("exported") / "run.mcap"
    kinds = {"/odom": Odometry, "/imu": Imu}
    types = {name: TopicType(kind.type_name) for name, kind in kinds.items()}
    with open_recorder(str(path), types, live=False) as recorder:
        for number in range(100):
            stamp_ns = START_S * S + number * S // 10
            recorder.write("/odom", odometry([number / 10, 0, 0], stamp_ns / S), stamp_ns)
            recorder.write(
                "/imu", Imu([0, 0, 0, 1], [0, 0, number], [0, 0, 9.81], header=Header(stamp_ns))
            )
    return path


@pytest.fixture
def show(port, tmp_path):
    """Shows a graph, paused; a browser of its files."""
    ends = []

    def show(graph):
        playback = Playback(hold=True)
        playback.pause()
        runtime = LocalRuntime(graph, playback)
        runtime.start()
        page = Page(ViewOptions(port=port, record_dir=tmp_path))
        page.open(runtime)
        client = Live(port, "/live/files")
        ends.extend([client.socket.close, page.close, runtime.stop])
        client.read_until(lambda: "exportable" in client.state)
        return client

    yield show
    for end in ends:
        end()


def export(client, name, start=2.0, end=4.0, **more):
    client.send("export", name=name, start=start, end=end, **more)
    client.read_until(
        lambda: client.state.get("exporting") is False and f"{name}: " in client.state["exported"]
    )


def test_a_range_is_read_by_other_tools(show, recorded, tmp_path, port):
    client = show(recording_pipeline(open_recording(recorded)))
    assert client.state["exportable"] == ["/imu", "/odom"]
    export(client, "part.mcap")
    export(client, "part.bag", topics=["/odom"])
    export(client, "part.csv")
    with (tmp_path / "part.mcap").open("rb") as file:
        messages = list(make_reader(file).iter_messages())
    seconds = {channel.topic: [] for _, channel, _ in messages}
    for _, channel, message in messages:
        seconds[channel.topic].append((message.log_time - START_S * S) / S)
    expected = [2 + number / 10 for number in range(21)]
    assert seconds == {"/odom": pytest.approx(expected), "/imu": pytest.approx(expected)}
    with AnyReader([tmp_path / "part.bag"]) as bag:
        assert {one.topic: one.msgcount for one in bag.connections} == {"/odom": 21}
    with (tmp_path / "part.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["time"]) for row in rows] == pytest.approx([at - 2 for at in expected])
    assert rows[0]["stamp"] == f"{START_S + 2}.000000000"
    assert [float(row["/odom:pose.pose.position.x"]) for row in rows] == pytest.approx(expected)
    assert [float(row["/imu:angular_velocity.z"]) for row in rows] == list(range(20, 41))
    client.read_until(lambda: len(client.state["links"]) == 3)
    query = "/?ask=recorded&name=part.csv&from=0"
    assert get(port, query, **{HEADER: "1"})[2] == (tmp_path / "part.csv").read_text()


def test_a_film_and_its_marks(show, tmp_path, capsys):
    film = write_video(tmp_path / "film.mkv", numbered(50))
    client = show(film_pipeline(film))
    export(client, "part.mp4", 0.4, 1.0)
    with av.open(str(tmp_path / "part.mp4")) as part:
        times = [frame.time for frame in part.decode(video=0)]
    assert times == pytest.approx([0.04 * number for number in range(16)])
    marks = Marks(film)
    marks.set(1.0, "end")
    marks.set(0.4, "begin")
    between = ["convert", str(film), str(tmp_path / "same.mp4"), "--between", "begin", "end"]
    assert main(between) == 0
    with av.open(str(tmp_path / "same.mp4")) as part:
        assert [frame.time for frame in part.decode(video=0)] == times
    capsys.readouterr()
    for options in (["--between", "begin", "nowhere"], [*between[3:], "--start", "1"]):
        assert main([*between[:2], str(tmp_path / "no.mp4"), *options]) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1


def test_several_sources_are_exported_where_they_were_moved_to(show, recorded, tmp_path):
    later = tmp_path / "later.mcap"
    later.write_bytes(recorded.read_bytes())
    graph = recording_pipeline(open_joined([recorded, later]), odom="")
    client = show(graph.configured({"player": {"later": 1.0}}))
    export(client, "both.csv", 0.0, 1.0, topics=["/run/imu", "/later/imu"])
    command = ["convert", str(recorded), str(later), str(tmp_path / "same.csv")]
    part = ["--offset", "later.mcap=1", "--duration", "1.05", "--topics", "/run/imu", "/later/imu"]
    assert main([*command, *part]) == 0
    text = (tmp_path / "both.csv").read_text()
    assert (tmp_path / "same.csv").read_text() == text
    *_, last = csv.DictReader(text.splitlines())
    assert float(last["/run/imu:angular_velocity.z"]) == 10
    assert float(last["/later/imu:angular_velocity.z"]) == 0


@pytest.mark.parametrize("name", ["../a.mcap", "/tmp/a.mcap", ".a.mcap", "there.mcap", "a.txt"])
def test_names_are_those_of_recordings(show, recorded, tmp_path, name, port):
    there = tmp_path / "there.mcap"
    there.write_text("precious")
    client = show(recording_pipeline(open_recording(recorded)))
    with Live(port, "/live/nodes") as notices:
        client.send("export", name=name, start=0.0)
        notices.read_until(lambda: notices.state.get("notices"))
    client.send("export", name="a.mcap", start=0.0, topics=["/none"])
    client.send("export", name="a.mcap", start=-1.0)
    with Live(port, "/live/files", VIEW_TOKEN) as viewer:
        viewer.send("export", name="viewer.mcap", start=0.0)
        viewer.read_until(lambda: "exporting" in viewer.state)
    export(client, "after.mcap")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["after.mcap", "there.mcap"]
    assert there.read_text() == "precious"


def test_an_export_ends_before_the_disk_is_full(show, recorded, monkeypatch, port):
    monkeypatch.setattr(exporter, "disk_reserve", lambda total: (1 << 60, "much"))
    client = show(recording_pipeline(open_recording(recorded)))
    begin = exporter.begin_conversion

    def slow(*arguments, **more):
        conversion = begin(*arguments, **more)
        run = conversion.run

        def wait_and_run():
            while not conversion.stopped:
                pass
            run()

        conversion.run = wait_and_run
        return conversion

    monkeypatch.setattr(exporter, "begin_conversion", slow)
    with Live(port, "/live/nodes") as notices:
        client.send("export", name="a.mcap", start=0.0)
        notices.read_until(lambda: notices.said("less than much left"))
