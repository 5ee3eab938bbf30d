"""What was measured beside a film, by the time in it."""

import csv
import struct
import sys
from collections import Counter
from contextlib import closing

import forked
import numpy as np
import pytest
from made_videos import numbered, write_video

from ros_visualise.core import limits
from ros_visualise.data import Image, Imu, NavSatFix
from ros_visualise.geometry.rotations import to_matrix
from ros_visualise.graph.pipelines import film_pipeline
from ros_visualise.nodes.streamer import StreamerParams
from ros_visualise.nodes.streamer import film as film_source
from ros_visualise.sources import demux, info, open_source
from ros_visualise.sources.logs.gopro import is_whole, read_samples
from ros_visualise.sources.playback import Playback
from ros_visualise.sources.telemetry import Film, telemetry_of
from ros_visualise.sources.video import Video

SRT = """1
00:00:01,000 --> 00:00:02,000
HOME(149.0251,-20.2532) 2017.08.05 14:11:51
GPS(149.0251,-20.2533,16) BAROMETER:1.9

2
00:00:04,000 --> 00:00:05,000
HOME(149.0251,-20.2532) 2017.08.05 14:11:54
GPS(149.0300,-20.2600,16) BAROMETER:2.5
"""


@pytest.fixture(scope="module")
def karma(recordings):
    return recordings / "video" / "gopro_karma_drone.mp4"


@pytest.fixture(scope="module")
def series(karma):
    return {one.topic: one for one in telemetry_of(karma)}


def klv(key, kind, size, *rows):
    """One item of GPMF."""
    data = b"".join(rows)
    head = struct.pack(">4sBBH", key.encode(), ord(kind) if kind else 0, size, len(data) // size)
    return head + data + bytes(-len(data) % 4)


def nest(key, *items):
    return klv(key, "", 1, b"".join(items))


def test_a_film_as_a_recording_has_its_telemetry(karma, recordings, tmp_path):
    """In ``info`` and in what is converted from it, not in what is played alone."""
    with (recordings / "video" / "DERIVED_gopro_karma_telemetry.csv").open() as file:
        fixes = sum(line.startswith("GLPI,") for line in file)
    found = info(karma)
    counts = {topic: one["messages"] for topic, one in found["topics"].items()}
    assert (counts["/image_raw"], counts["/fix"]) == (362, fixes)
    assert found["messages"] == sum(counts.values())
    with closing(open_source(karma)) as film:
        entries = [(entry.topic, entry.stamp_ns) for entry in film.read()]
        later = [entry.topic for entry in film.read(start_ns=11_000_000_000, topics=["/fix"])]
    assert Counter(topic for topic, _ in entries) == counts
    assert [stamp for _, stamp in entries] == sorted(stamp for _, stamp in entries)
    assert 0 < len(later) < fixes / 4
    target = tmp_path / "film.mcap"
    command = [sys.executable, "-m", "ros_visualise", "convert", karma, target]
    assert forked.run([*command, "--topics", "/fix", "/imu/data"], timeout=60).returncode == 0
    kept = {topic: one["messages"] for topic, one in info(target)["topics"].items()}
    assert kept == {"/fix": counts["/fix"], "/imu/data": counts["/imu/data"]}


def test_fixes_are_those_of_the_track(series, recordings):
    with (recordings / "video" / "DERIVED_gopro_karma_telemetry.csv").open() as file:
        rows = [row for row in csv.reader(file) if row and row[0] == "GLPI"]
    fixes = [series["fix"].make(number) for number in range(len(series["fix"].stamps_ns))]
    assert len(fixes) == len(rows)
    for fix, row in zip(fixes, rows, strict=True):
        assert isinstance(fix, NavSatFix)
        found = fix.latitude, fix.longitude, fix.altitude
        assert found == pytest.approx(tuple(map(float, row[2:5])), abs=1e-6)


def test_times_are_those_in_the_film(series):
    stamps_ns = series["fix"].stamps_ns
    assert stamps_ns[0] == 0
    assert (np.diff(stamps_ns) > 0).all()
    assert 11.5e9 < stamps_ns[-1] < 13.1e9
    steps_ns = np.diff(series["imu"].stamps_ns)
    assert np.median(steps_ns) == pytest.approx(5e6, rel=0.02)  # 200 a second


def test_the_images_of_a_film_are_not_read_for_its_telemetry(karma, monkeypatch):
    read = []

    class Counted(demux._File):
        def read(self, size=-1):
            data = super().read(size)
            read.append(len(data))
            return data

    monkeypatch.setattr(demux, "_File", Counted)
    demux.open_container(karma).close()
    to_open = sum(read)
    read.clear()
    assert len(telemetry_of(karma)) == 2
    assert sum(read) == to_open > 0


def test_telemetry_that_is_too_large_is_left_out_and_said(karma, monkeypatch, caplog):
    monkeypatch.setattr(limits, "_max_memory", 1 << 20)
    assert telemetry_of(karma) == []
    assert "played without its telemetry: a file of 0 MiB" in caplog.text


def test_a_drone_in_the_air_feels_its_weight(series):
    imu = series["imu"]
    messages = [imu.make(number) for number in range(0, len(imu.stamps_ns), 10)]
    assert all(isinstance(one, Imu) for one in messages)
    mean = np.mean([one.linear_xyz for one in messages], axis=0)
    assert mean[2] == pytest.approx(9.8, abs=0.6)
    assert abs(np.mean([one.angular_xyz for one in messages])) < 0.3
    assert messages[0].orientation_covariance[0, 0] == -1


def test_streams_are_scaled_by_their_own_scales():
    gps = struct.pack(">5l", 331253688, -1173310668, 15711, 2003, 880)
    scale = klv("SCAL", "l", 4, struct.pack(">5l", 10_000_000, 10_000_000, 1000, 1000, 100))
    fix = klv("GPSF", "L", 4, struct.pack(">L", 3))
    packet = nest("DEVC", nest("STRM", fix, scale, klv("GPS5", "l", 20, gps, gps)))
    [samples] = read_samples(packet, {"GPS5"})
    assert (samples.key, samples.fix, samples.values.shape) == ("GPS5", 3, (2, 5))
    assert samples.values[1] == pytest.approx([33.1253688, -117.3310668, 15.711, 2.003, 8.8])
    assert is_whole(packet + bytes(12), {"GPS5"})
    for cut in range(1, len(packet)):
        list(read_samples(packet[:cut], {"GPS5"}))  # as far as it goes
        assert not is_whole(packet[:cut], {"GPS5"})


@pytest.mark.parametrize(
    ("key", "offset", "damage"),
    [
        ("DEVC", 0, b""),
        ("DEVC", 0, bytes(8)),
        ("ACCL", 6, b"\xff\xff"),
        ("ACCL", 5, b"\5"),
        ("GLPI", 4, b"\1"),
    ],
)
def test_damaged_telemetry_is_said_where_the_film_is_played(karma, tmp_path, key, offset, damage):
    content = bytearray(karma.read_bytes())
    place = content.index(key.encode()) + offset
    content[place : place + len(damage)] = damage
    path = tmp_path / "film.mp4"
    path.write_bytes(content)
    notes = ["damaged telemetry packets, read as far as possible: 1"] if damage else []
    played = film_source(path).make(StreamerParams(str(path)), Playback(rate=0))
    assert played.report().get("lost", {"notes": []})["notes"] == notes
    played.close()
    assert info(path)["lost"]["notes"] == notes
    with closing(open_source(path)) as film:
        assert sum(1 for _ in film.read()) >= 362
        assert film.loss.notes == notes


def test_subtitles_beside_a_film_are_taken(tmp_path, recordings):
    film = tmp_path / "film.avi"
    film.symlink_to(recordings / "video" / "vtest.avi")
    assert telemetry_of(film) == []
    (tmp_path / "film.SRT").write_text(SRT)
    [origin, series] = telemetry_of(film)
    assert (origin.topic, origin.make(0).altitude) == ("map_origin", 0)  # z is the height
    assert series.stamps_ns.tolist() == [1_000_000_000, 4_000_000_000]
    assert series.make(1).longitude == 149.03


def test_images_and_measurements_come_in_their_order(karma, series):
    video = Video(karma)
    film = Film(video, list(series.values()))
    last_ns = max(one.stamps_ns[-1] for one in series.values())
    assert film.duration_ns == last_ns > video.duration_ns  # so that the timeline does not grow
    items = []
    for time_ns, item in film.read(2_000_000_000):
        items.append((time_ns, item.output))
        if time_ns > 3_000_000_000:
            break
    times_ns = [time_ns for time_ns, _ in items]
    assert [output for _, output in items[:3]] == ["fix", "imu", "image"]  # as of that time
    assert times_ns == sorted(times_ns)
    counts = {name: sum(one == name for _, one in items) for name in ("image", "fix", "imu")}
    assert counts["image"] == pytest.approx(31, abs=2)
    assert counts["fix"] == pytest.approx(4, abs=1)
    assert counts["imu"] == pytest.approx(200, abs=10)


def test_the_pipeline_has_topics_for_what_is_there(karma):
    graph = film_pipeline(karma)
    outputs = {"image": "/image_raw", "fix": "/fix", "imu": "/imu/data"}
    assert graph.source.outputs == outputs
    path = next(node for node in graph.nodes if node.name == "path")
    assert path.inputs == {"fix": "/fix"}
    source = graph.source.type.make(graph.source.params, Playback(rate=0, frames=3))
    kinds = {name: type(message) for name, message in source.messages()}
    assert kinds["image"] is Image
    assert kinds["imu"] is Imu
    source.close()


def test_a_film_alone_has_the_pipeline_of_images(recordings):
    graph = film_pipeline(recordings / "video" / "vtest.avi")
    assert graph.source.outputs == {"image": "/image_raw"}
    assert [node.name for node in graph.nodes] == ["fps_control", "filters", "edge_detector"]


def test_subtitles_with_the_gimbal_give_the_pose_of_the_camera(tmp_path):
    """As of newer drones of DJI: 30 m above the point of take-off, looking down to the east."""
    film = tmp_path / "DJI_1.MP4"
    write_video(film, numbered(5))
    text = ""
    for number, yaw in enumerate((90, 91)):
        text += (
            f"{number + 1}\n00:00:0{number},000 --> 00:00:0{number + 1},000\n[focal_len: 24.00]"
            " [latitude: 47.5] [longitude: 8.25] [rel_alt: 30.0 abs_alt: 430.0]"
            f" [gb_yaw: {yaw}.0 gb_pitch: -90.0 gb_roll: 0.0]\n\n"
        )
    film.with_suffix(".SRT").write_text(text)
    series = {one.topic: one for one in telemetry_of(film)}
    assert series.keys() == {"map_origin", "tf", "fix", "lens"}
    assert series["map_origin"].make(0).altitude == 400
    (first,) = series["tf"].make(0).transforms
    np.testing.assert_allclose(first.translation_xyz, [0, 0, 30], atol=1e-6)
    np.testing.assert_allclose(to_matrix(first.quat_xyzw) @ [0, -1, 0], [1, 0, 0], atol=1e-9)
    assert len(series["lens"].stamps_ns) == 1
    assert np.diff(series["tf"].stamps_ns).tolist() == [200_000_000] * 6  # between and after them
    assert series["fix"].make(0).altitude == 430
