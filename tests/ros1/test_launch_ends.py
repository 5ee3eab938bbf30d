"""A launch whose source fails ends with it, and leaves nothing behind."""

import re
import subprocess
from pathlib import Path

import pytest
from ros_graph import free_port


@pytest.mark.parametrize("pipeline", ["false", "true"])
def test_a_video_that_is_missing_ends_the_launch_with_the_reason(workspace, tmp_path, pipeline):
    port = free_port()
    video = tmp_path / "missing.mp4"
    command = ["roslaunch", "-p", str(port), "ros_visualise", "main_video.launch"]
    done = subprocess.run(
        [*command, f"video:={video}", "view:=none", "rviz:=false", f"pipeline:={pipeline}"],
        env={**workspace.environment, "ROS_MASTER_URI": f"http://127.0.0.1:{port}"},
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        timeout=300,
    )
    before, _, after = done.stdout.partition("REQUIRED process")
    assert f"{video}: no such file" in "".join(before.splitlines()[-4:])  # others may be talking
    assert "exit code 2" in after
    assert "escalating" not in after
    started = re.findall(r"started with pid \[(\d+)\]", done.stdout)
    assert len(started) >= 3
    assert not [pid for pid in started if Path(f"/proc/{pid}").exists()]
