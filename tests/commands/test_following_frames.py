"""`ros-visualise bag --odom /tf:PARENT.CHILD`: the path of one frame in another."""

import numpy as np
import pytest

from ros_visualise.data import Header, Odometry, Transforms, TransformStamped
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import open_recorder
from ros_visualise.sources.opening import open_recording

TF = TopicType("tf2_msgs/msg/TFMessage")
TURNED = np.array([0, 0, np.sqrt(0.5), np.sqrt(0.5)])  # to the left
UPRIGHT = np.array([0.0, 0, 0, 1])
STEP_NS = 100_000_000
STEPS = 40


def moves(parent, child, position, quat, stamp_ns):
    header = Header(stamp_ns, parent)
    return Transforms((TransformStamped(child, np.array(position, float), quat, header),))


@pytest.fixture
def bag(tmp_path):
    """A robot drives to its left from (1, 2) in the map; its camera is half a metre ahead."""
    path = tmp_path / "drive.bag"
    odom = TopicType("nav_msgs/msg/Odometry")
    with open_recorder(str(path), {"/tf": TF, "/tf_static": TF, "/odom": odom}) as recorder:
        recorder.write(
            "/tf_static", moves("base", "camera", [0.5, 0, 0], UPRIGHT, STEP_NS), STEP_NS
        )
        for step in range(1, STEPS + 1):
            now_ns = step * STEP_NS
            recorder.write("/tf", moves("map", "odom", [1, 2, 0], TURNED, now_ns), now_ns)
            recorder.write("/tf", moves("odom", "base", [step, 0, 0], UPRIGHT, now_ns), now_ns)
            header = Header(now_ns, "odom")
            recorder.write("/odom", Odometry(np.array([-step, 0.0, 0]), UPRIGHT, header=header))
    return path


QUICK = ["--view", "none", "--rate", "0"]


def last_path(recorded):
    recording = open_recording(recorded)
    *_, last = recording.read(topics=["/path"])
    recording.close()
    return last.message.content


def test_the_path_is_that_of_the_frame_and_what_the_trajectory_is(run, bag, tmp_path):
    frames, out = "/tf:map.camera", tmp_path / "out.mcap"
    assert run("bag", bag, "--odom", frames, *QUICK, "--record", out)[0] == 0
    path = last_path(out)
    steps = np.arange(1, STEPS + 1)
    expected = np.stack([np.ones(STEPS), 2.5 + steps, np.zeros(STEPS)], 1)
    assert path.header.frame_id == "map"
    np.testing.assert_array_equal(path.stamps_ns, steps * STEP_NS)
    np.testing.assert_allclose(path.positions_xyz, expected, atol=1e-9)
    assert run("trajectory", bag, tmp_path / "out.tum", "--topic", frames)[0] == 0
    written = np.loadtxt(tmp_path / "out.tum")
    np.testing.assert_allclose(written[:, 1:4], path.positions_xyz, atol=1e-6)
    np.testing.assert_allclose(written[:, 4:], path.quats_xyzw, atol=1e-6)


def test_the_frames_can_be_set_as_any_parameters(run, bag, tmp_path):
    out = tmp_path / "out.mcap"
    chosen = ["--odom", "/tf:map.camera", "--set", "path.tf_parent=odom"]
    assert run("bag", bag, *chosen, *QUICK, "--record", out)[0] == 0
    assert last_path(out).header.frame_id == "odom"
    np.testing.assert_allclose(last_path(out).positions_xyz[-1], [STEPS + 0.5, 0, 0])


PAIR = "--odom /tf:PARENT.CHILD"
REFUSALS = [
    (["--odom", "/tf"], "choose two frames as /tf:PARENT.CHILD from base, camera, map, odom"),
    (["--odom", "/tf:map"], "write a pair of frames as /tf:PARENT.CHILD"),
    (["--odom", "/tf:map.mars"], "no frame 'mars'; known frames: base, camera, map, odom"),
    (["--odom", "/tf:base.camera"], "camera does not move relative to base"),
    (["--odom", "/odom:map.base"], "no poses on /odom; choose from /tf"),
    (["--odom", "/tf:map.base", "--topics", "/odom"], "/tf is not played; add it to --topics"),
    (["--odom", "none", "--set", "path.tf_parent=map"], PAIR),
    (["--topics", "/tf", "--set", "path.tf_parent=map"], PAIR),
    (["--set", "path.tf_parent=map", "--set", "path.tf_child=base"], PAIR),
    (["--set", "path.tf_child=base"], PAIR),
]


@pytest.mark.parametrize(("options", "says"), REFUSALS, ids=[" ".join(o) for o, _ in REFUSALS])
def test_what_cannot_be_followed_is_said_in_a_line(run, bag, options, says):
    status, said = run("bag", bag, *options, *QUICK)
    assert status == 2
    [line] = said.splitlines()
    assert says in line


def test_a_file_of_parameters_is_answered_alike(run, bag, tmp_path):
    (tmp_path / "p.yaml").write_text("path: {tf_parent: map}")
    status, said = run("bag", bag, "--odom", "none", "--params", tmp_path / "p.yaml", *QUICK)
    assert (status, PAIR in said) == (2, True)


def test_where_nothing_is_recorded_the_nodes_that_there_are_are_listed(run):
    status, said = run("demo", "landscape", *QUICK, "--set", "path.tf_parent=map")
    assert status == 2
    assert "no node 'path'; choose from landscape, fps_control" in said


def test_transforms_without_frames_leave_nothing_to_choose(run, tmp_path):
    path = tmp_path / "none.bag"
    with open_recorder(str(path), {"/tf": TF}) as recorder:
        recorder.write("/tf", Transforms(()), STEP_NS)
    status, said = run("trajectory", path, tmp_path / "out.tum")
    assert status == 2
    assert said == f"ros-visualise: {path}: contains neither poses nor readable transforms\n"
