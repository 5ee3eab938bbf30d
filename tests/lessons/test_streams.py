"""Lessons on what a robot's sensors send, and on the graph that runs."""

from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from made_mcaps import numbered, write_mcap
from sentences import holds, shown

from ros_visualise.commands import main
from ros_visualise.data import (
    Header,
    Imu,
    MarkerType,
    Odometry,
    Transforms,
    TransformStamped,
)
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.geometry.rotations import from_rpy
from ros_visualise.lessons.lesson import StepResult
from ros_visualise.lessons.methods.drift import aligned, error_by_heading, wrapped
from ros_visualise.lessons.pipeline import lesson_pipeline
from ros_visualise.lessons.topics import frames, graph, sensors

UP = np.array([0.0, 0, 0, 1])


def stamped(seconds):
    return Header(round(seconds * 1e9), "map")


def test_a_constant_heading_error_leads_astray_by_its_chord():
    way = np.stack([np.linspace(0, 50, 400), np.zeros(400)], axis=1)
    error = error_by_heading(way, np.full(400, 0.03))
    assert error[-1] == pytest.approx(2 * 50 * np.sin(0.015))
    growing = error_by_heading(way, np.linspace(0, 0.04, 400))
    assert growing[-1] == pytest.approx(50 * 0.04 / 2, rel=1e-3)
    closed = np.stack([np.cos(t := np.linspace(0, 2 * np.pi, 500)), np.sin(t)], axis=1)
    assert error_by_heading(closed, np.full(500, 0.3))[-1] == pytest.approx(0, abs=1e-9)


def test_paths_are_aligned_by_their_beginnings():
    way = np.array([[1.0, 1], [2, 1], [2, 3]])
    turned = aligned(way, np.zeros(3), np.array([5.0, 5]), np.pi / 2)
    assert turned == pytest.approx(np.array([[5.0, 5], [5, 6], [3, 6]]))
    assert wrapped(np.array([3 * np.pi, -0.1, 2 * np.pi + 0.2])) == pytest.approx(
        [-np.pi, -0.1, 0.2]
    )


def test_drift_is_told_of_odometry_that_turns_too_far():
    drift = frames.Drift.declared.make(None)
    answers = []
    for t in np.arange(0, 10.01, 0.05):
        true = Odometry(np.array([t, 0, 0]), UP, header=stamped(t))
        wrong = np.array([t * np.cos(0.1) + 7, t * np.sin(0.1), 0])
        heading = from_rpy(np.array([0, 0, 0.1 if t else 0.0]))
        drift.step(None, truth=true)
        answers.append(drift.step(None, odom=Odometry(wrong, heading, header=stamped(t))))
    told = [answer["text"].text for answer in answers if answer]
    assert len(told) == 10  # once a second, from the second pose on
    assert "off by +5.73°" in told[-1]
    expected = 2 * 9.05 * np.sin(0.05)
    assert f"the error is {expected:.3f} m" in told[-1]


def test_the_tree_tells_what_tf_answers():
    tree, known = frames.Tree.declared.make(None), FrameTree()
    links = [
        ("map", "odom", [1, 0, 0]),
        ("odom", "base_link", [0, 2, 0]),
        ("map", "tag", [0, 0, 3]),
    ]
    tf = Transforms(tuple(
        TransformStamped(child, np.array(xyz, float), UP, Header(10**9, parent))
        for parent, child, xyz in links
    ))  # fmt: skip
    known.add(tf)
    answer = tree.step(tf, frames.TreeParams(), known)["text"].text
    assert "here there are 4" in " ".join(answer.split())
    product = "T(map ← base_link) = T(map ← odom) · T(odom ← base_link)"
    assert product in " ".join(answer.split())
    assert "base_link is at (1.000, 2.000, 0.000) m in map" in answer
    assert tree.step(tf, frames.TreeParams(), known) is None  # within a second
    tree.reset()
    asked = frames.TreeParams(target="tag", source="{count}")
    assert "no frame '{count}'" in tree.step(tf, asked, known)["text"].text


def test_the_tree_of_a_robot_holds_its_static_frames_too():
    with ExitStack() as undo:
        graph = lesson_pipeline(frames.LESSON, None, Path(), at_end=False, undo=undo)
        tree = next(node for node in graph.nodes if node.name == "tree")
        assert tree.inputs == {"tf": "/tf", "tf_static": "/tf_static"}


def test_an_imu_is_told_by_its_numbers():
    random = np.random.default_rng(0)
    measured, allan = (one.declared.make(None) for one in (sensors.ImuReadings, sensors.Allan))
    for number in range(3000):
        turn, force = random.normal(0, 0.02, 3), random.normal((0, 0, 9.81), 0.3)
        imu = Imu(UP, turn, force, header=stamped(number / 100))
        said = measured.step(imu, sensors.MeasuredParams()), allan.step(imu, None)
        if all(said):
            texts = [answer["text"].text for answer in said]
    assert "100 measurements per second" in texts[0]
    density = float(texts[1].partition("gyroscope")[2].partition("N = ")[2].split()[0])
    assert density == pytest.approx(0.02 / 10, rel=0.05)


def allan_text(rates):
    """The lesson's text on an IMU whose rates and accelerations are these, 10 a second."""
    told, allan = None, sensors.Allan.declared.make(None)
    for number, rate in enumerate(rates):
        imu = Imu(UP, np.full(3, rate), np.full(3, rate), header=stamped(number / 10))
        told = allan.step(imu, None) or told
    return " ".join(told["text"].text.split())


def test_of_white_noise_the_density_and_the_least_of_the_curve_are_printed():
    random = np.random.default_rng(3)
    white = random.normal(0, 0.02, 3000) + 3e-4 * np.cumsum(random.normal(0, 1, 3000))
    text = allan_text(white)
    density = float(text.partition("gyroscope, rad/s N = ")[2].split()[0])
    assert density == pytest.approx(0.02 * 10**-0.5, rel=0.15)
    floor, time_s = shown(text, "floor = N at N s")
    _, bias = shown(text, "floor / N = N")
    assert bias == pytest.approx(floor / 0.664, rel=0.01)
    assert time_s < 300
    assert floor < 0.02


def test_a_curve_that_does_not_fall_has_no_noise_density():
    text = allan_text(np.cumsum(np.random.default_rng(4).normal(0, 0.1, 1500)))
    gyroscope = text.partition("gyroscope")[2].partition("accelerometer")[0]
    assert "no white noise: slope +0." in gyroscope
    assert "N =" not in gyroscope
    assert "floor" not in gyroscope


def test_a_curve_that_still_falls_at_its_end_has_no_floor():
    text = allan_text(np.random.default_rng(5).normal(0, 0.1, 2000))
    assert "floor not reached" in text


def test_without_truth_odometry_is_drawn_alone_and_says_so():
    drift = frames.Drift.declared.make(None)
    for t in range(5):
        answer = drift.step(None, odom=Odometry(np.array([t, 0, 0.0]), UP, header=stamped(t)))
    text = " ".join(answer["text"].text.split())
    assert "The path from odometry is 4.00 m long so far" in text
    assert "the drift is unknown, and only odometry is drawn" in text
    assert b"odometry only; true path unknown" in answer["image"].data.figure.svg()


def test_the_message_of_an_image_is_counted_in_bytes():
    picture = np.zeros((24, 32, 3), np.uint8)
    image = StepResult(picture, "bgr8", stamped(12.25), work=picture)
    text = " ".join(graph.message(image, None)["text"].text.split())
    assert "header.stamp 12.250000000 header.frame_id map height, width 24, 32" in text
    holds(text, "step N bytes per row data N bytes", 96, 2304)


def test_means_and_deviations_of_an_imu_are_those_of_the_last_seconds():
    random = np.random.default_rng(8)
    measured = sensors.ImuReadings.declared.make(None)
    rows = random.normal([0, 0, 0.1, 0, 0, 9.81], 0.05, (400, 6))
    answers = [
        measured.step(
            Imu(UP, row[:3], row[3:], header=stamped(number / 50)),
            sensors.MeasuredParams(seconds=2),
        )
        for number, row in enumerate(rows)
    ]
    answer = [one for one in answers if one][-1]
    last = int(answer["text"].header.stamp_ns / 1e9 * 50 + 0.5)
    recent = rows[last - 100 : last + 1]
    text = " ".join(answer["text"].text.split())
    mean, spread = recent.mean(axis=0), recent.std(axis=0)
    holds(text, "gives N measurements per second. In the last N s", 50, 2)
    holds(text, "rad/s mean (N, N, N) dev. (N, N, N)", *mean[:3], *spread[:3])
    holds(text, "m/s² mean (N, N, N) dev. (N, N, N)", *mean[3:], *spread[3:])


def test_the_graph_counts_messages_and_drops(monkeypatch):
    monkeypatch.setattr(graph, "sleep", lambda seconds: None)
    rate, slow = graph.Rate(None), graph.Slow(None)
    for number in range(1, 21):
        image = StepResult(np.zeros((4, 4), np.uint8), "mono8", stamped(number / 25))
        counted = rate.step(image, None)
        if number % 4 == 1:
            taken = slow.step(counted["image"], graph.SlowParams(busy_ms=100))
    text = " ".join(counted["text"].text.split())
    assert shown(text, "N messages have arrived on this topic. The rate of the last N:") == [20, 20]
    assert shown(text, "by their stamps N a second, every N ± N ms") == [25, 40, 0]
    text = " ".join(taken["text"].text.split())
    holds(text, "spends N ms on each message, so it can process N per second", 100, 10)
    holds(text, "Of N messages it processed N; N (N %) were dropped", 17, 5, 12, 100 * 12 / 17)


def test_an_imu_of_a_few_measurements_says_how_many_are_needed():
    measured, allan = (one.declared.make(None) for one in (sensors.ImuReadings, sensors.Allan))
    for number in range(5):
        imu = Imu(UP, np.zeros(3), UP[:3], header=stamped(number / 10))
        said = measured.step(imu, sensors.MeasuredParams()), allan.step(imu, None)
    assert all(
        "5 measurements so far; at least 100 are needed" in answer["text"].text for answer in said
    )


def test_the_allan_deviation_is_taken_anew_as_the_time_grows():
    allan = sensors.Allan.declared.make(None)
    told = []
    for number in range(4000):
        imu = Imu(UP, UP[:3] + number % 7, UP[:3] + number % 5, header=stamped(number / 10))
        if allan.step(imu, None) and number > 100:
            told.append(number / 10)
    assert told[1] - told[0] == pytest.approx(1, abs=0.11)
    assert told[-1] - told[-2] == pytest.approx(0.02 * told[-2], abs=0.11)
    assert allan._samples.times_s[-1] == pytest.approx(399.9)


def test_the_car_stands_on_the_road_around_its_imu():
    told = sensors.Car.declared.make(None)
    imu = Imu(UP, np.zeros(3), np.zeros(3), header=Header(10**9, "imu_link"))
    markers = told.step(imu, None)["markers"].markers
    assert told.step(imu, None) is None
    assert all(one.header.frame_id == "imu_link" and one.frame_locked for one in markers)
    assert len({one.id for one in markers}) == len(markers)
    wheels = [one for one in markers if one.type == MarkerType.CYLINDER and one.scale_xyz[0] > 0.5]
    grounds = {one.position_xyz[2] - one.scale_xyz[0] / 2 for one in wheels}
    assert len(wheels) == 4
    assert [*grounds] == pytest.approx([-0.93]), "of the road below the IMU"
    names = {one.text for one in markers if one.type == MarkerType.TEXT_VIEW_FACING}
    assert {"Velodyne", "gray cameras", "colour cameras", "GPS and IMU"} == names


def test_a_slow_node_counts_what_it_did_not_get():
    slow = graph.Slow.declared.make(None)
    pixels = np.zeros((4, 4), np.uint8)
    for number in (5, 6, 9, 14):
        image = StepResult(pixels, "mono8", work=graph._Counted(number))
        text = slow.step(image, graph.SlowParams(busy_ms=0))["text"].text
    assert "10 messages it processed 4; 6 (60 %) were dropped" in " ".join(text.split())


def test_a_rate_is_told_by_stamps_and_by_the_clock(monkeypatch):
    arrivals = iter(range(0, 10**10, 10**8))
    monkeypatch.setattr(graph, "monotonic_ns", lambda: next(arrivals))
    rate = graph.Rate.declared.make(None)
    pixels = np.zeros((4, 4), np.uint8)
    for number in range(11):
        image = StepResult(pixels, "mono8", stamped(number / 20))
        text = rate.step(image, None)["text"].text
    assert "20.00 a second, every 50.0 ± 0.0 ms" in text
    assert "10.00 a second, every 100.0 ± 0.0 ms" in text


def test_a_film_is_no_recording(tmp_path, capsys):
    film = tmp_path / "film.avi"
    film.write_bytes(b"RIFF")
    assert main(["explain", "sensors", str(film), "--view", "none"]) == 2
    assert "not a recording; sensors takes a recording," in capsys.readouterr().err
    assert main(["explain", "sensors", str(tmp_path / "x.bag"), "--view", "none"]) == 2
    assert "x.bag: no such file" in capsys.readouterr().err


def test_a_recording_without_what_is_needed_is_refused_in_one_line(tmp_path, capsys):
    words = tmp_path / "words.mcap"
    write_mcap(words, numbered(range(5)))
    for topic, kind in (("sensors", "Imu"), ("frames", "Transforms")):
        assert main(["explain", topic, str(words), "--view", "none"]) == 2
        err = capsys.readouterr().err
        assert f"no topic of type {kind}" in err
        assert len(err.splitlines()) == 1
