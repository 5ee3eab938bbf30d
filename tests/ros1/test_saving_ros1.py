"""Parameters that are saved on a ROS graph, and loaded again by the tools of ROS."""

import subprocess
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import rospy
from made_videos import write_video
from ros_graph import PATIENCE_S, wait_for
from std_srvs.srv import Trigger

from ros_visualise.commands import main
from ros_visualise.core.yaml_files import load_yaml, parse_yaml
from ros_visualise.sources.opening import open_recording

SET = ("_blur:=median", "_threshold:=77", "_gray:=false", "_blur_sigma:=1.0e-07")


@pytest.fixture
def saved(ros_master, start, tmp_path):
    """A file of the parameters of filters, and what its node has on the parameter server."""
    if rospy.has_param("/filters"):  # of a node that a test launched before
        rospy.delete_param("/filters")
    start("filters", *SET, f"_record_dir:={tmp_path}")
    rospy.wait_for_service("/filters/save_parameters", PATIENCE_S)
    answer = rospy.ServiceProxy("/filters/save_parameters", Trigger)()
    assert answer.success, answer.message
    values = rospy.get_param("/filters")
    values.pop("record_dir")
    return Path(answer.message), values


def test_rosparam_loads_what_was_saved(saved, ros_master):
    path, values = saved
    assert values["blur"] == "median"
    assert values["blur_sigma"] == 1e-7
    ros_master.call("rosparam", "load", str(path), "/again")
    try:
        assert rospy.get_param("/again") == {"filters": values}
    finally:
        rospy.delete_param("/again")


def test_roslaunch_loads_what_was_saved(saved, workspace, tmp_path):
    path, values = saved
    launch = tmp_path / "load.launch"
    launch.write_text(f'<launch><rosparam command="load" ns="launched" file="{path}"/></launch>')
    done = subprocess.run(
        ["roslaunch", "--dump-params", str(launch)],
        env=workspace.environment,
        text=True,
        capture_output=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    dumped = parse_yaml(done.stdout.encode())
    assert dumped == {f"/launched/filters/{name}": value for name, value in values.items()}


def test_the_command_line_loads_what_the_viewer_saved(saved, start, tmp_path):
    images = [np.full((48, 64, 3), 40 * number, np.uint8) for number in range(4)]
    video = write_video(tmp_path / "v.mkv", images)
    start("streamer", f"_path:={video}", "_loop:=true", "_frame_id:=front")
    start("viewer", "_view:=none", f"_record_dir:={tmp_path}", wait=False)
    path = wait_for(lambda: saved_by_viewer({"filters", "streamer"}), "the viewer")
    target = tmp_path / "out.mcap"
    options = ["--view", "none", "--rate", "0", "--params", path, "--record", str(target)]
    assert main(["video", str(video), *options]) == 0
    with closing(open_recording(target)) as recording:
        images = [entry.message.content for entry in recording.read(topics=["/processed_image"])]
    assert {image.header.frame_id for image in images} == {"front"}


def saved_by_viewer(nodes):
    """The file that it saves, once it knows these nodes."""
    try:
        answer = rospy.ServiceProxy("/viewer/save_parameters", Trigger)()
    except rospy.ServiceException:
        return None
    return answer.success and set(load_yaml(Path(answer.message))) >= nodes and answer.message
