"""The Python API, used as a program of somebody else uses it."""

import subprocess
import sys
from importlib.metadata import version

import cv2
import numpy as np
import pytest
from made_videos import numbered, write_video

import ros_visualise as rv
from ros_visualise.core.supervision import PROCESS

IMAGES = numbered(40)


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    """A film of 40 images, 25 in a second, without loss."""
    return write_video(tmp_path_factory.mktemp("film") / "a.mkv", IMAGES)


@pytest.fixture(scope="module")
def husky(recordings):
    return recordings / "bags" / "robot_localization_test1.bag"


def test_names_are_imported_when_they_are_used():
    code = """
import sys
import ros_visualise as rv
assert "numpy" not in sys.modules
import ros_visualise.messages.qos
from ros_visualise import commands
assert "ros_visualise.api" not in sys.modules
assert callable(rv.messages) and rv.messages.qos
rv.open
assert "ros_visualise.api" in sys.modules
assert {"open", "frames", "__version__", "messages"} <= set(dir(rv))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_messages_can_be_the_first_name_that_is_used():
    code = "import ros_visualise as rv; assert callable(rv.messages) and callable(rv.messages)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_version_is_that_of_the_package():
    assert rv.__version__ == version("ros_visualise")
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = rv.nothing


def test_every_public_name_is_documented():
    import ros_visualise.api as api

    for name in api.__all__:
        assert getattr(rv, name) is getattr(api, name) or name == "messages"
        assert getattr(api, name).__doc__ or name == "ImageLike", name


def test_frames_are_arrays_with_stamps(film):
    frames = list(rv.frames(film))
    assert [frame.stamp_ns for frame in frames] == [40_000_000 * n for n in range(40)]
    for frame, image in zip(frames, IMAGES, strict=True):
        np.testing.assert_array_equal(frame.pixels, image)
        assert frame.encoding == "bgr8"
    part = [frame.stamp_ns for frame in rv.frames(film, start_s=0.2, end_s=0.4)]
    assert part == [200_000_000, 240_000_000, 280_000_000, 320_000_000, 360_000_000]


def test_films_folders_and_recordings_are_opened_alike(film, husky, tmp_path):
    for number, image in enumerate(IMAGES[:3]):
        cv2.imwrite(str(tmp_path / f"{number}.png"), image)
    for path, topic, count in (
        (film, "/image_raw", 40),
        (tmp_path, "/image_raw", 3),
        (husky, "/fix", 989),
    ):
        with rv.open(path) as source:
            assert source.topics[topic].messages in (count, 0)
            assert len(list(source.messages(topic))) == count
            assert source.losses == ()
    assert [frame.pixels[0, 0].tolist() for frame in rv.frames(tmp_path)] == [
        image[0, 0].tolist() for image in IMAGES[:3]
    ]


def test_messages_are_of_one_kind_and_in_order(husky):
    samples = list(rv.messages(husky, "/fix", kind=rv.NavSatFix, end_s=20))
    assert all(isinstance(sample.message, rv.NavSatFix) for sample in samples)
    stamps_ns = [sample.stamp_ns for sample in samples]
    assert stamps_ns == sorted(stamps_ns)
    assert {sample.topic for sample in rv.messages(husky, kind=rv.Odometry, end_s=2)} == {
        "/husky_velocity_controller/odom"
    }


@pytest.mark.parametrize(
    ("topic", "kind", "says"),
    [
        ("/imu/dta", rv.Message, "no topic '/imu/dta'; did you mean /imu/data?"),
        ("/none", rv.Message, "choose from /fix, /husky_velocity_controller/odom, /imu/data"),
        ("/fix", rv.Odometry, "/fix: its messages are NavSatFix, not Odometry"),
    ],
)
def test_topics_that_do_not_fit_are_named(husky, topic, kind, says):
    with pytest.raises(rv.UsageError) as raised:
        list(rv.messages(husky, topic, kind=kind))
    assert says in str(raised.value)


def test_a_run_loses_nothing(recordings):
    """A film whose images wait for nobody lost 48 of 795 in a default subscription."""
    graph = rv.pipeline(recordings / "video" / "vtest.avi")
    stamps_ns = [one.message.header.stamp_ns for one in rv.run(graph, "/edges", kind=rv.Image)]
    assert stamps_ns == [100_000_000 * n for n in range(795)]


def test_a_run_gives_topics_in_the_same_order_each_time(film):
    graph = rv.pipeline(film).configured({"edge_detector": {"low": 20, "high": 60}})
    topics = ["/image_raw", "/edges", "/processed_image"]
    one, other = ([(s.topic, s.stamp_ns) for s in rv.run(graph, topics)] for _ in range(2))
    assert one == other
    assert [topic for topic, _ in one[:3]] == ["/image_raw", "/processed_image", "/edges"]
    assert len(one) == 3 * len({stamp_ns for _, stamp_ns in one})


def test_a_graph_runs_again(film, recordings):
    bag = rv.pipeline(recordings / "bags" / "evo_tf_example.bag")
    for graph, count in ((rv.pipeline(film), 40), (bag, 517)):
        topic = next(iter(graph.source.topics))
        counts = [sum(1 for _ in rv.run(graph, topic)) for _ in range(2)]
        assert counts == [count, count]


def test_a_camera_is_a_source_too():
    graph = rv.pipeline("test").configured({"camera": {"size": "64x48"}})
    sample = next(rv.run(graph, "/edges", kind=rv.Image))
    assert sample.message.width == 64


def test_wrong_paths_are_noticed_at_once(tmp_path):
    with pytest.raises(rv.OpenError, match="no such file"):
        rv.pipeline(tmp_path / "none.mp4")


def test_leaving_a_run_early_ends_it(film):
    for sample in rv.run(rv.pipeline(film), "/edges"):
        assert sample.topic == "/edges"
        break


def test_an_unknown_topic_of_a_run_is_named(film):
    with pytest.raises(rv.UsageError, match="no topic '/edgs'; did you mean /edges"):
        next(rv.run(rv.pipeline(film), "/edgs"))


@rv.node("fragile", inputs={"edges": rv.Image}, outputs={"edges": rv.Image})
def fragile(edges, params):
    """Fails at its eleventh image."""
    if edges.header.stamp_ns == 400_000_000:
        raise ZeroDivisionError("nothing to divide by")
    return edges


def test_a_failing_node_raises_with_its_name(film):
    graph = rv.pipeline(film).insert(fragile, after="edge_detector")
    seen = []
    with pytest.raises(rv.NodeFailed, match="fragile failed: ZeroDivisionError: nothing") as raised:
        seen.extend(sample.stamp_ns for sample in rv.run(graph, "/fragile"))
    assert isinstance(raised.value.__cause__, ZeroDivisionError)
    assert len(seen) <= 10
    PROCESS.forget()


class TestNodes:
    def test_every_answer_is_a_mapping_by_output(self):
        image = IMAGES[0]
        edges = rv.node_function("edge_detector", low=20, high=60)(image)
        gray = rv.node_function("filters")(image)
        assert edges.of("edges", rv.Image).encoding == "mono8"
        assert [*gray] == ["image"]
        np.testing.assert_array_equal(
            edges.of("edges", rv.Image).pixels, cv2.Canny(cv2.cvtColor(image, 6), 20, 60)
        )

    def test_one_of_ones_own_takes_what_it_declares(self):
        own = rv.node_function(fragile)
        assert own(rv.Image(IMAGES[0], "bgr8")).of("edges", rv.Image).height == 24
        for call, says in (
            (lambda: own(), "fragile: takes edges: Image"),
            (lambda: own(image=IMAGES[0]), "fragile: no input 'image'; choose from edges"),
            (lambda: own("picture.png"), "fragile: edges takes Image, not str"),
            (lambda: own(IMAGES[0], IMAGES[1]), "fragile: takes edges: Image"),
        ):
            with pytest.raises(rv.UsageError) as raised:
                call()
            assert str(raised.value) == says

    @pytest.mark.parametrize(
        ("params", "says"),
        [
            ({"low": 900}, "low=900: must be from 0 to 800"),
            ({"lov": 1}, "no parameter 'lov'; did you mean low?"),
            ({"aperture": 4}, "aperture=4: choose one of 3, 5, 7"),
        ],
    )
    def test_parameters_are_checked(self, params, says):
        with pytest.raises(rv.ParameterError, match=says):
            rv.node_function("edge_detector", **params)

    def test_swapped_thresholds_are_remarked_on(self, caplog):
        swapped = rv.node_function("edge_detector", low=61, high=21)(IMAGES[0])
        right = rv.node_function("edge_detector", low=21, high=61)(IMAGES[0])
        edges = [one.of("edges", rv.Image).pixels for one in (swapped, right)]
        np.testing.assert_array_equal(*edges)
        assert [record.getMessage() for record in caplog.records] == [
            "edge_detector: low=61 is above high=21; using low=21 and high=61 instead"
        ]


def test_trajectories_are_arrays_with_errors(recordings, tmp_path):
    texts = recordings / "trajectory" / "evo"
    found = rv.trajectory(texts / "freiburg1_xyz-rgbdslam.txt")
    truth = rv.trajectory(texts / "freiburg1_xyz-groundtruth.txt")
    assert (len(found), found.positions_xyz.shape, found.quats_xyzw.shape) == (
        788,
        (788, 3),
        (788, 4),
    )
    errors = found.errors(truth, align="se3", delta="0.5m")
    assert errors.rmse_m == pytest.approx(0.013470, abs=1e-6)  # as evo_ape -a prints
    assert errors.summary()["rpe_m"]["rmse"] == pytest.approx(0.024082, abs=1e-6)
    assert errors.summary()["rpe_m"]["pairs"] == len(errors.rpe_m)
    lines = (
        f"{t / 1e9} {x} {y} {z} 0 0 0 1\n"
        for t, (x, y, z) in zip(truth.stamps_ns, truth.positions_xyz, strict=True)
    )
    (tmp_path / "points.tum").write_text("".join(lines))
    against = found.errors(rv.trajectory(tmp_path / "points.tum"), align="se3")
    assert {*against.summary()} == {"ate_m", "rpe_m"}  # a file without attitudes has no degrees
    aligned = found.align(truth)
    assert aligned.errors(truth).rmse_m == pytest.approx(0.013470, abs=1e-6)
    aligned.to_tum(tmp_path / "a.tum")
    again = rv.trajectory(tmp_path / "a.tum")
    np.testing.assert_array_equal(again.stamps_ns, aligned.stamps_ns)
    np.testing.assert_array_equal(again.positions_xyz, aligned.positions_xyz)
    assert found._repr_html_().startswith("<svg")
    for wrong, says in (
        (
            lambda: found.errors(truth, delta="1"),
            r"give a number of poses \(1f\), a distance \(10m\)",
        ),
        (lambda: found.align(truth, "se4"), "no alignment 'se4'; did you mean se3"),
        (lambda: rv.trajectory(texts / "KITTI_00_gt.txt", "/odom"), "a text file without topics"),
        (
            lambda: rv.trajectory(texts / "KITTI_00_gt.txt").to_tum(tmp_path / "b.tum"),
            "has no time stamps, which the TUM format requires",
        ),
    ):
        with pytest.raises(rv.UsageError, match=says):
            wrong()
    assert not (tmp_path / "b.tum").exists()


def test_tags_are_detected_with_their_poses(recordings):
    picture = recordings / "tags" / "fiducials" / "tag_01_d7_14cm.png"
    [tag] = rv.detect(picture, "5x5_1000")
    assert tag.id == "1"
    K = np.array([[1006.126, 0, 655.864], [0, 1004.015, 490.614], [0, 0, 1]])
    size = cv2.imread(str(picture)).shape
    [located] = rv.detect(
        cv2.imread(str(picture)),
        "5x5_1000",
        size_m=0.14,
        calibration=rv.CameraInfo(size[0], size[1], K),
    )
    distance_m = np.linalg.norm(located.hypotheses[0].position_xyz)
    seen_px = np.linalg.norm(located.corners_uv[0] - located.corners_uv[1])
    assert distance_m == pytest.approx(0.14 * 1005 / seen_px, rel=0.05)


def test_a_camera_is_calibrated_from_pictures(recordings):
    pictures = sorted((recordings / "calib" / "opencv").glob("left*.jpg"))
    found = rv.calibrate(pictures, "9x6")
    assert found.info.K[0, 0] == pytest.approx(535.92, rel=0.01)  # as published
    with pytest.raises(rv.UsageError, match="no board found in 3 images"):
        rv.calibrate(IMAGES[:3])
    with pytest.raises(rv.UsageError, match="no 'chess'; did you mean chessboard"):
        rv.calibrate(IMAGES[:3], pattern="chess")


@pytest.mark.parametrize(
    "image", [np.zeros((9, 9)), np.zeros((9, 9, 7), np.uint8), np.zeros(9, np.uint8), 7]
)
def test_what_is_no_image_is_answered_by_what_is(image):
    with pytest.raises(rv.UsageError, match="give "):
        rv.detect(image)


def test_recordings_are_converted(husky, tmp_path):
    made = rv.convert(husky, tmp_path / "a.mcap", topics=["/fix"], duration_s=20)
    assert made.path == tmp_path / "a.mcap"
    assert made.losses == ()
    assert made.messages == {"/fix": len(list(rv.messages(made.path)))}
    with pytest.raises(rv.OpenError, match="give overwrite=True"):
        rv.convert(husky, tmp_path / "a.mcap")
    with pytest.raises(rv.UsageError, match="no topic /fx; did you mean /fix"):
        rv.convert(husky, tmp_path / "b.mcap", topics=["/fx"])


@pytest.mark.parametrize(
    ("encoding", "value", "shown"),
    [
        ("mono8", 7, 7),
        ("bgr8", (10, 20, 30), (10, 20, 30)),
        ("rgb8", (30, 20, 10), (10, 20, 30)),
        ("rgba8", (30, 20, 10, 255), (10, 20, 30)),
        ("mono16", 0x1234, 0x12),
        ("32FC1", 1.5, 0),
    ],
)
def test_an_image_shows_itself_in_a_notebook(encoding, value, shown):
    dtype = {"mono16": np.uint16, "32FC1": np.float32}.get(encoding, np.uint8)
    png = rv.Image(np.full((4, 5, *np.shape(value)), value, dtype), encoding)._repr_png_()
    pixels = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED)
    assert pixels.shape[:2] == (4, 5)
    assert (pixels == shown).all()


def test_an_image_without_pixels_shows_nothing():
    assert rv.Image(np.zeros((0, 4), np.uint8), "mono8")._repr_png_() is None
