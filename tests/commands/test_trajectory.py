"""`ros-visualise trajectory`: files that evo reads, and the numbers and errors that evo has."""

import json
import subprocess
import sys
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from evo.tools import file_interface
from rosbags.rosbag1 import Reader

from ros_visualise.commands import main
from ros_visualise.commands.trajectory.work import short_names


@pytest.fixture
def run(monkeypatch, capsys):
    """Run the command; its exit status, output and what it said of errors."""
    monkeypatch.setattr("signal.signal", lambda *_: None)

    def run(*arguments):
        status = main(["trajectory", *map(str, arguments)])
        said = capsys.readouterr()
        return status, said.out, said.err

    return run


BAGS = [
    ("evo_ROS_example.bag", "ORB-SLAM", 8362),
    ("robot_localization_test1.bag", "/husky_velocity_controller/odom", 3952),
]


@pytest.mark.parametrize(("bag", "topic", "count"), BAGS)
def test_a_bag_gives_what_evo_reads_from_it(recordings, run, tmp_path, bag, topic, count):
    source, out = recordings / "bags" / bag, tmp_path / "out.tum"
    status, said, _ = run(source, out, "--topic", topic, "--json")
    assert status == 0
    with Reader(source) as reader:
        expected = file_interface.read_bag_trajectory(reader, topic)
    found = file_interface.read_tum_trajectory_file(out)
    order = np.argsort(expected.timestamps, kind="stable")
    np.testing.assert_allclose(found.timestamps, expected.timestamps[order], rtol=0, atol=1e-6)
    np.testing.assert_array_equal(found.positions_xyz, expected.positions_xyz[order])
    np.testing.assert_array_equal(
        found.orientations_quat_wxyz, expected.orientations_quat_wxyz[order]
    )
    report = json.loads(said)
    assert report["poses"] == count
    assert report["length_m"] == pytest.approx(found.path_length)
    assert report["duration_s"] == pytest.approx(found.timestamps[-1] - found.timestamps[0])
    assert report["mean_mps"] == pytest.approx(report["length_m"] / report["duration_s"])
    assert report["mean_mps"] <= report["top_mps"]


def test_kitti_files_hold_the_same_poses(recordings, run, tmp_path):
    source, out = recordings / "bags" / "evo_tf_example.bag", tmp_path / "out.txt"
    frames = "--topic=/tf:odom.base_link"
    assert run(source, out, frames, "--format", "kitti")[0] == 0
    assert run(source, tmp_path / "out.tum", frames)[0] == 0
    found = file_interface.read_kitti_poses_file(out)
    expected = file_interface.read_tum_trajectory_file(tmp_path / "out.tum")
    assert found.num_poses == 517
    np.testing.assert_allclose(found.poses_se3, expected.poses_se3, atol=1e-12)


def test_stamps_keep_their_nanoseconds(recordings, run, tmp_path):
    source, out = recordings / "bags" / "robot_localization_test1.bag", tmp_path / "out.tum"
    run(source, out, "--topic", "/husky_velocity_controller/odom")
    with Reader(source) as reader:
        [connection] = [c for c in reader.connections if c.topic.endswith("/odom")]
        _, _, raw = next(reader.messages([connection]))
    seconds, nanoseconds = np.frombuffer(raw[4:12], "<u4")
    assert out.read_text().split(" ", 1)[0] == f"{seconds}.{nanoseconds:09d}"


def test_tf_as_the_bag_has_it(recordings, run, tmp_path):
    """Its chain is one moving transform and one static, which does not turn."""
    source, out = recordings / "bags" / "evo_tf_example.bag", tmp_path / "out.tum"
    assert run(source, out, "--topic", "/tf:odom.base_link")[0] == 0
    found = file_interface.read_tum_trajectory_file(out)
    moving = tmp_path / "moving.tum"
    assert run(source, moving, "--topic", "/tf:odom.base_footprint")[0] == 0
    footprint = file_interface.read_tum_trajectory_file(moving)
    assert found.num_poses == footprint.num_poses == 517
    offsets = [
        np.linalg.inv(a) @ b for a, b in zip(footprint.poses_se3, found.poses_se3, strict=True)
    ]
    np.testing.assert_allclose(offsets, [offsets[0]] * 517, atol=1e-9)
    np.testing.assert_allclose(offsets[0][:3, :3], np.eye(3), atol=1e-9)
    assert (np.diff(found.timestamps) > 0).all()


def test_the_fixes_of_a_husky(recordings, run, tmp_path):
    source = recordings / "bags" / "robot_localization_test1.bag"
    status, said, _ = run(source, tmp_path / "out.tum", "--topic", "/fix", "--json")
    report = json.loads(said)
    assert status == 0
    assert report["frame"] == "map"
    assert report["poses"] + sum(report["skipped"].values()) == 989
    [first, *_] = (tmp_path / "out.tum").read_text().splitlines()
    assert first.split(" ")[1:] == ["0.0", "0.0", "0.0", "0.0", "0.0", "0.0", "1.0"]
    assert 359 < report["length_m"] < 500  # by its wheels 359 m: fixes jitter


@pytest.mark.parametrize(
    ("drive", "length_m"),
    [("2011_09_26_drive_0001_sync", 107.0), ("2011_09_26_drive_0005_sync", 69.4)],
)
def test_drives_of_kitti(recordings, run, tmp_path, drive, length_m):
    for topic in ("/odom", "/gps/fix"):
        out = tmp_path / "out.tum"
        command = (recordings / "oxts" / drive, out, "--topic", topic, "--overwrite", "--json")
        assert json.loads(run(*command)[1])["length_m"] == pytest.approx(length_m, abs=0.15)


def test_a_drive_is_where_kittis_ground_truth_has_it(recordings, run, tmp_path):
    """The benchmark's sequence 04 is made of the first 271 samples of this drive."""
    out = tmp_path / "out.tum"
    run(recordings / "oxts" / "2011_09_30_drive_0016_sync", out, "--topic", "/odom")
    found = file_interface.read_tum_trajectory_file(out)
    truth_file = recordings / "trajectory" / "kitti_odom_gt" / "04.txt"
    truth = file_interface.read_kitti_poses_file(truth_file)
    found.reduce_to_ids(list(range(271)))
    found.align(truth)
    errors = np.linalg.norm(found.positions_xyz - truth.positions_xyz, axis=1)
    assert np.sqrt((errors**2).mean()) < 0.1
    assert found.path_length == pytest.approx(truth.path_length, abs=0.5)


def test_the_flight_of_a_film(recordings, run):
    """A path of 81 m, as parsed by other hands."""
    film = recordings / "video" / "gopro_karma_drone.mp4"
    status, said, _ = run(film, "--topic", "/fix", "--json")
    assert status == 0
    assert json.loads(said)["length_m"] == pytest.approx(81, abs=0.5)


def test_what_it_says(recordings, run, tmp_path):
    status, said, errors = run(
        recordings / "bags" / "robot_localization_test1.bag", tmp_path / "out.tum"
    )
    assert (status, errors) == (0, f"{tmp_path / 'out.tum'}: written\n")
    assert said.splitlines()[:3] == [
        "/husky_velocity_controller/odom: 3952 poses in the frame odom",
        "length:     358.797 m",
        "duration:   395.304 s",
    ]


class TestPlot:
    @pytest.fixture
    def plot(self, recordings, run, tmp_path):
        """Draw the 4 m of a robot, of which there is a text file too."""

        def plot(name):
            source, out = recordings / "bags" / "evo_tf_example.bag", tmp_path / "way.tum"
            frames = "--topic=/tf:odom.base_link"
            assert run(source, out, frames, "--plot", tmp_path / name)[0] == 0
            return tmp_path / name

        return plot

    def test_svg(self, plot, tmp_path):
        root = ElementTree.parse(plot("way.svg")).getroot()
        space = "{http://www.w3.org/2000/svg}"
        texts = [one.text for one in root.iter(f"{space}text")]
        assert "/tf:odom.base_link: 4.00 m in 51.6 s" in texts
        assert {"x (m)", "y (m)", "z (m)", "time (s)", "start", "end"} <= set(texts)
        curves = [one for one in root.iter(f"{space}polyline") if "#1f6fb2" in one.get("stroke")]
        drawn = np.array([p.split(",") for p in curves[0].get("points").split()], float)
        true = file_interface.read_tum_trajectory_file(tmp_path / "way.tum").positions_xyz[:, :2]
        # One scale for x and y, and y upwards.
        scales = np.ptp(drawn, axis=0) / np.ptp(true, axis=0)
        assert scales[0] == pytest.approx(scales[1], rel=0.01)
        moved = (true[-1] - true[0]) * scales[0] * [1, -1]
        np.testing.assert_allclose(drawn[-1] - drawn[0], moved, atol=0.1)

    def test_png(self, plot):
        pixels = cv2.imread(str(plot("way.png")))
        assert pixels.shape[1:] == (1588, 3)  # 210 mm
        assert (pixels == (178, 111, 31)).all(axis=2).sum() > 3000  # of the line, blue green red


EVO = {
    ("freiburg", "se3"): {"rmse": 0.013470, "mean": 0.012024, "median": 0.011183, "max": 0.034760},
    ("freiburg", "sim3"): {"rmse": 0.013389, "std": 0.005966, "min": 0.000733, "sse": 0.140731},
    ("kitti", "sim3"): {"rmse": 0.937709, "mean": 0.872693, "max": 2.693500, "sse": 3992.893611},
    ("bag", "sim3"): {"rmse": 5.404707, "mean": 4.836811, "median": 4.621377, "min": 0.579268},
}
"""What ``evo_ape`` (1.38.1) prints for these, with -a and with -as."""


@pytest.fixture
def compared(recordings):
    """The arguments that compare an estimate with the truth."""
    texts, bags = recordings / "trajectory" / "evo", recordings / "bags"
    truth = texts / "freiburg1_xyz-groundtruth.txt"
    return {
        "freiburg": [texts / "freiburg1_xyz-rgbdslam.txt", "--truth", truth],
        "kitti": [texts / "KITTI_00_ORB.txt", "--truth", texts / "KITTI_00_gt.txt"],
        "bag": [bags / "evo_ROS_example.bag", "--topic=ORB-SLAM", "--truth", "groundtruth"],
    }


class TestTruth:
    @pytest.mark.parametrize(("name", "align"), EVO, ids=" ".join)
    def test_the_ate_is_what_evo_prints(self, run, compared, name, align):
        status, said, _ = run(*compared[name], "--align", align, "--json")
        report = json.loads(said)
        assert status == 0
        found = report["errors"]["ate"]["translation_m"]
        expected = EVO[name, align]
        assert {key: found[key] for key in expected} == pytest.approx(expected, abs=1e-6)

    def test_the_rpe_is_what_evo_prints(self, run, compared):
        """``evo_rpe tum ... -a -d 0.5 -u m``."""
        command = (*compared["freiburg"], "--align=se3", "--delta=0.5m")
        errors = json.loads(run(*command, "--json")[1])["errors"]
        assert errors["rpe"]["translation_m"] == pytest.approx(
            {
                "rmse": 0.024082,
                "mean": 0.022580,
                "median": 0.022975,
                "std": 0.008371,
                "min": 0.004619,
                "max": 0.034115,
                "sse": 0.009859,
            },
            abs=1e-6,
        )
        [row] = [line for line in run(*command)[1].splitlines() if line.startswith("RPE (m)")]
        assert row.split()[:7] == ["RPE", "(m)", "over", "0.5", "m", "0.024082", "0.022580"]

    def test_several_topics_and_a_file_beside_them(self, run, recordings, tmp_path):
        bag, orb = recordings / "bags" / "evo_ROS_example.bag", tmp_path / "orb.tum"
        assert run(bag, orb, "--topic=ORB-SLAM")[0] == 0
        topics = ["--topic=ORB-SLAM", "--topic=S-PTAM", "--with", orb, "--truth=groundtruth"]
        status, said, _ = run(bag, *topics, "--align=sim3", "--json")
        report = json.loads(said)
        first, second, third = report["trajectories"]
        assert status == 0
        assert [first["topic"], second["topic"]] == ["/ORB-SLAM", "/S-PTAM"]
        assert third["topic"] == str(orb)
        assert third["errors"] == first["errors"] != second["errors"]
        assert report["truth"]["topic"] == "/groundtruth"

    def test_a_topic_of_another_recording(self, run, recordings, tmp_path):
        bag, orb = recordings / "bags" / "evo_ROS_example.bag", tmp_path / "orb.tum"
        run(bag, orb, "--topic=ORB-SLAM")
        status, said, _ = run(orb, "--truth", f"{bag}@/groundtruth", "--align=sim3", "--json")
        assert status == 0
        found = json.loads(said)["errors"]["ate"]["translation_m"]["rmse"]
        assert found == pytest.approx(EVO["bag", "sim3"]["rmse"], abs=1e-6)

    def test_out_holds_it_as_it_was_aligned(self, run, compared, tmp_path):
        out = tmp_path / "aligned.tum"
        source, _, truth = compared["freiburg"]
        assert run(source, out, "--truth", truth, "--align=sim3")[0] == 0
        status, said, _ = run(out, "--truth", truth, "--json")
        found = json.loads(said)["errors"]["ate"]["translation_m"]["rmse"]
        assert (status, found) == (0, pytest.approx(0.013389, abs=1e-6))

    def test_what_has_no_attitudes_has_no_rotations(self, run, recordings):
        drive = recordings / "oxts" / "2011_09_26_drive_0005_sync"
        command = [drive, "--topic=/gps/fix", "--truth=/odom"]
        status, said, _ = run(*command, "--align=se3", "--json")
        errors = json.loads(said)["errors"]
        assert status == 0
        assert errors["rpe"]["translation_m"]["max"] < 0.1
        assert errors["rpe"]["rotation_deg"] is errors["ate"]["rotation_deg"] is None
        assert errors["ate"]["translation_m"]["rmse"] < 0.1
        told = run(*command)[1]
        assert "(no rotations in /gps/fix: no errors in degrees, and the RPE compares" in told
        assert "not aligned, though the frames differ (map, odom)" in told

    def test_a_file_of_positions_alone_has_no_rotations(self, run, compared, tmp_path):
        """Programs that know no attitude write 0 0 0 1, which is not the truth."""
        source, _, truth = compared["freiburg"]
        points, aligned = tmp_path / "points.tum", tmp_path / "aligned.tum"
        places = [line.split()[:4] for line in truth.read_text().splitlines() if line[0] != "#"]
        points.write_text("".join(f"{' '.join(one)} 0 0 0 1\n" for one in places))
        said = run(source, "--truth", points, "--align=se3")[1]
        assert f"(no rotations in {points}: no errors in degrees" in said
        assert "(deg)" not in said
        [ate, rpe] = [line.split() for line in said.splitlines() if line[1:6] in ("TE (m", "PE (m")]
        whole = run(source, "--truth", truth, "--align=se3")[1].splitlines()
        assert [ate] == [line.split() for line in whole if line.startswith("ATE (m)")]
        assert float(rpe[5]) < 0.005  # evo_rpe -r point_distance
        status, said, _ = run(source, "--truth", points, "--align=origin")  # a robot may never turn
        assert (status, "try --align se3" in said) == (0, True)
        assert run(points, aligned, "--truth", truth, "--align=se3")[0] == 0
        assert {line.split(maxsplit=4)[4] for line in aligned.read_text().splitlines()} == {
            "0.0 0.0 0.0 1.0"
        }

    def test_without_out_it_is_drawn(self, run, compared, monkeypatch):
        monkeypatch.setenv("COLUMNS", "80")
        status, said, errors = run(*compared["kitti"], "--align=sim3")
        lines = said.splitlines()
        assert (status, errors) == (0, "")
        assert lines[0].startswith("+---")
        assert "x (m): -271.4 to 292.6" in lines  # a car, by its camera: x to the right, z ahead
        assert "z (m): -17.6 to 479.1" in lines
        assert sum(line.startswith("|") and "*" in line for line in lines) > 15
        assert any("4541 poses, aligned by sim3, scale 1.004698" in line for line in lines)

    def test_a_figure_for_a_paper(self, run, compared, tmp_path):
        picture = tmp_path / "way.svg"
        names = ["--label=SLAM", "--title=", "--width=88"]
        run(*compared["freiburg"], "--align=se3", *names, "--plot", picture)
        root = ElementTree.parse(picture).getroot()
        texts = [one.text for one in root.iter("{http://www.w3.org/2000/svg}text")]
        assert root.get("width") == "333"  # 88 mm
        assert {"SLAM", "freiburg1_xyz-groundtruth.txt (truth)"} <= {*texts}
        run(*compared["freiburg"], "--plot", tmp_path / "way.pdf")
        assert (tmp_path / "way.pdf").read_bytes().startswith(b"%PDF-1.4")

    def test_files_are_named_by_what_tells_them_apart(self, tmp_path):
        for name in ("a/x.tum", "b/x.tum"):
            (tmp_path / name).parent.mkdir()
            (tmp_path / name).write_text("")
        found = short_names([str(tmp_path / "a/x.tum"), str(tmp_path / "b/x.tum"), "/odom"])
        assert found == ["a/x.tum", "b/x.tum", "/odom"]
        assert short_names([f"{tmp_path / 'a/x.tum'}@/odom"]) == ["x.tum@/odom"]

    def test_the_picture(self, run, compared, tmp_path):
        picture = tmp_path / "way.svg"
        run(*compared["freiburg"], "--align=se3", "--plot", picture)
        root = ElementTree.parse(picture).getroot()
        space = "{http://www.w3.org/2000/svg}"
        texts = [one.text for one in root.iter(f"{space}text")]
        assert texts.count("x (m)") == texts.count("z (m)") == 2  # it moves in all three planes
        assert "distance from the truth (m)" in texts
        assert any("groundtruth.txt (truth)" in text for text in texts)
        run(*compared["freiburg"], "--plane=xz", "--plot", picture, "--overwrite")
        root = ElementTree.parse(picture).getroot()
        texts = [one.text for one in root.iter(f"{space}text")]
        assert texts.count("x (m)") == texts.count("z (m)") == texts.count("y (m)") == 1


class TestRefusals:
    @pytest.fixture
    def refused(self, run, capsys):
        def refused(*arguments):
            status, out, error = run(*arguments)
            assert (status, out) == (2, "")
            [line] = error.splitlines()
            return line

        return refused

    def test_files_that_exist(self, recordings, refused, run, tmp_path):
        source, out = recordings / "bags" / "evo_tf_example.bag", tmp_path / "out.tum"
        out.write_text("mine")
        assert "--overwrite" in refused(source, out, "--topic", "/tf:odom.base_link")
        picture = out.rename(tmp_path / "out.svg")
        assert "--overwrite" in refused(source, tmp_path / "new.tum", "--plot", picture)
        assert not (tmp_path / "new.tum").exists()
        assert (tmp_path / "out.svg").read_text() == "mine"
        (tmp_path / "new.tum").write_text("mine")
        assert (
            run(source, tmp_path / "new.tum", "--topic=/tf:odom.base_link", "--overwrite")[0] == 0
        )
        assert len((tmp_path / "new.tum").read_text().splitlines()) == 517

    def test_the_recording_itself(self, refused, tmp_path):
        source = tmp_path / "a.bag"
        source.write_bytes(b"#ROSBAG V2.0\n")
        assert "in use as the source" in refused(source, source, "--overwrite")

    def test_topics(self, recordings, refused, tmp_path):
        bag, out = recordings / "bags" / "evo_ROS_example.bag", tmp_path / "out.tum"
        for said in (refused(bag, out), refused(bag, out, "--topic", "/none")):
            assert "ORB-SLAM, " in said
            assert "groundtruth" in said
        tf = recordings / "bags" / "evo_tf_example.bag"
        assert "base_footprint, base_link, odom" in refused(tf, out)
        assert "no frame 'mars'" in refused(tf, out, "--topic", "/tf:odom.mars")
        assert not out.exists()

    def test_pictures_and_inputs(self, refused, tmp_path):
        said = refused(tmp_path / "a.bag", tmp_path / "out.tum", "--plot", "a.jpg")
        assert "a.jpg: plots are PNG, SVG or PDF files" in said
        assert ".png or .svg or .pdf" in said
        same = tmp_path / "way.svg"
        assert "already in use" in refused(tmp_path / "a.bag", same, "--plot", same)
        assert "no such file" in refused(tmp_path / "a.bag", tmp_path / "out.tum")

    def test_comparisons_that_mean_nothing(self, recordings, refused, compared, tmp_path):
        bag, texts = recordings / "bags", recordings / "trajectory" / "evo"
        source, _, truth = compared["kitti"]
        assert "--truth" in refused(source, "--align=se3")
        assert "can store only one trajectory" in refused(
            source, tmp_path / "out.tum", "--with", truth
        )
        assert "no time stamps" in refused(source, tmp_path / "out.tum")
        tum = texts / "freiburg1_xyz-rgbdslam.txt"
        assert "would be matched by index" in refused(tum, "--truth", truth)
        times = texts / "KITTI_00_gt_times.txt"
        assert "neither TUM's 8 numbers" in refused(times)
        assert "neither TUM's 8 numbers" in refused(source, "--truth", times)
        robot = [bag / "evo_tf_example.bag", "--topic=/tf:odom.base_link"]
        assert "maximum difference" in refused(*robot, "--truth", tum)
        assert "choose from /tf" in refused(*robot, "--truth", "/nothing")
        assert "has no topics" in refused(source, "--truth", "/nothing")
        assert "has no topics" in refused(source, "--topic", "/odom")
        drive = recordings / "oxts" / "2011_09_26_drive_0005_sync"
        fixes = [drive, "--topic=/gps/fix", "--truth=/odom"]
        assert "no attitudes" in refused(*fixes, "--align=origin")
        line = tmp_path / "line.tum"
        line.write_text("".join(f"{n} {n} 0 0 0 0 0 1\n" for n in range(9)))
        assert "on a line" in refused(line, "--truth", line, "--align=se3")
        assert "in use" in refused(source, truth, "--truth", truth, "--overwrite")

    @pytest.mark.parametrize("delta", ["1", "0f", "1.5f", "-1m", "5 m", "nans", "1km"])
    def test_deltas(self, refused, compared, delta):
        said = refused(*compared["kitti"], f"--delta={delta}")
        assert (
            "give a number of poses (1f), a distance (10m), an angle (5deg) or a time (1s)" in said
        )

    def test_too_many_arguments_name_the_help_of_the_command(self, run, capsys):
        with pytest.raises(SystemExit):
            run("a.bag", "b.tum", "c.tum")
        said = capsys.readouterr().err
        assert said.endswith("unrecognized arguments: c.tum; see ros-visualise trajectory --help\n")

    def test_more_labels_than_paths(self, refused, compared):
        source, _, truth = compared["freiburg"]
        labels = ["--label=a", "--label=b", "--label=c"]
        assert "3 names for 2 paths" in refused(source, "--truth", truth, *labels)

    def test_a_picture_without_a_folder_leaves_no_file(self, recordings, refused, tmp_path):
        source, out = recordings / "bags" / "robot_localization_test1.bag", tmp_path / "out.tum"
        assert "no such folder" in refused(source, out, "--plot", tmp_path / "nowhere" / "way.svg")
        assert not out.exists()


def test_as_a_process(recordings, tmp_path):
    source = recordings / "bags" / "evo_tf_example"  # a folder of ROS 2
    command = [sys.executable, "-m", "ros_visualise", "trajectory", source]
    command += ["--topic", "/tf:odom.base_link", tmp_path / "out.tum"]  # OUT after an option
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, f"{tmp_path / 'out.tum'}: written\n")
    assert done.stdout.startswith("/tf:odom.base_link: 517 poses in the frame odom\n")
