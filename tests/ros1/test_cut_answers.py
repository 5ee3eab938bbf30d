"""A master whose answers are cut off while a node begins costs one line."""

import subprocess

from cutting_master import cutting

from ros_visualise.running.executables import command_of

BEGINS = "filters: the ROS master does not answer: "


def start(ros_master, uri, name, *args):
    return subprocess.Popen(
        [*command_of(name), f"__name:=cut_{name}", *args],
        env={**ros_master.environment, "ROS_MASTER_URI": uri},
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )


def test_a_node_that_cannot_begin_so_ends_with_one_line(ros_master):
    with cutting(ros_master.uri, "setParam") as master:
        node = start(ros_master, master.uri, "filters", "_threshold:=90")
        said = node.communicate(timeout=120)[0]
    assert node.returncode == 1
    assert any(line.startswith(BEGINS) for line in said.splitlines())
    assert "Traceback" not in said
