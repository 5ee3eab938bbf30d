"""Services of ours as any node calls them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing

import pytest
from sensor_msgs.srv import SetCameraInfo
from waiting import wait_for

from ros_visualise.core.errors import RosVisualiseError, Unreachable, UsageError
from ros_visualise.data import CameraInfo
from ros_visualise.runtime.ros2.services import result_of
from ros_visualise.runtime.ros2.session import Ros2Session
from ros_visualise.runtime.ros2.transport import Ros2Transport


def refuse(*_: object) -> None:
    raise UsageError("not now")


@pytest.fixture
def other(graph: dict[str, str]) -> Iterator[Ros2Transport]:
    made = Ros2Transport(Ros2Session("other", []))
    yield made
    made.close()


def test_an_action_is_done_or_its_error_is_the_answer(ros2: Ros2Transport, other: Ros2Transport):
    done: list[str] = []
    with closing(other.offer("~land", lambda: done.append("landed"))):
        ros2.call("/other/land")
    assert done == ["landed"]
    with closing(other.offer("~fly", refuse)), pytest.raises(RosVisualiseError, match="not now"):
        ros2.call("/other/fly")
    with pytest.raises(RosVisualiseError, match="no such service"):
        ros2.call("/other/swim")


def test_a_graph_that_was_left_cannot_be_asked(graph: dict[str, str]):
    gone = Ros2Transport(Ros2Session("gone", []))
    gone.listing()
    gone.close()
    with pytest.raises(Unreachable):
        gone.listing()
    with pytest.raises(Unreachable):
        gone.call("/other/land")


def test_a_calibration_comes_as_it_was_set(ros2: Ros2Transport, other: Ros2Transport):
    taken: list[CameraInfo] = []
    client = ros2.session.node.create_client(SetCameraInfo, "/camera/set_camera_info")
    with closing(other.offer_calibration("/camera/set_camera_info", taken.append)):
        wait_for(client.service_is_ready, "the service")
        request = SetCameraInfo.Request()
        request.camera_info.width, request.camera_info.height = 640, 480
        request.camera_info.distortion_model = "plumb_bob"
        request.camera_info.k = [500.0, 0, 320, 0, 510, 240, 0, 0, 1]
        request.camera_info.d = [0.1, 0.2, 0, 0, 0]
        assert result_of(client.call_async(request), 60).success
        assert (taken[0].width, taken[0].height) == (640, 480)
        assert taken[0].K.tolist() == [[500, 0, 320], [0, 510, 240], [0, 0, 1]]
    with closing(other.offer_calibration("/camera/set_camera_info", refuse)):
        wait_for(client.service_is_ready, "the service")
        answer = result_of(client.call_async(request), 60)
        assert (answer.success, answer.status_message) == (False, "not now")
    ros2.session.node.destroy_client(client)
