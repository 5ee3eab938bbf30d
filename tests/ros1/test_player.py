"""Recordings played onto a real graph, as stock ROS hears them."""

from pathlib import Path

import numpy as np
import pytest
import rosbag
import rospy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from peers import running
from ros_graph import end, wait_for
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from ros_visualise import data
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import open_recorder

S = 10**9
START = 1_600_000_000 * S
COUNT = 20


def recorded():
    """(Topic, time, message) of a camera, a pose and two static transforms."""
    K = np.array([[50.0, 0, 8], [0, 50, 6], [0, 0, 1]])
    rotation = [0.0, 0, 0, 1]
    for child in ("camera", "imu"):
        one = data.TransformStamped(child, [0, 0, 1.0], rotation, data.Header(START, "base_link"))
        yield "/tf_static", START, data.Transforms((one,))
    for i in range(COUNT):
        stamp = START + i * S // 20
        header = data.Header(stamp, "camera")
        yield "/cam/camera_info", stamp, data.CameraInfo(12, 16, K, header=header)
        pixels = np.full((12, 16, 3), i, np.uint8)
        yield "/cam/image_raw", stamp, data.Image(pixels, "bgr8", header)
        pose = data.PoseStamped([float(i), 0, 0], rotation, data.Header(stamp, "map"))
        yield "/pose", stamp, pose


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("player") / "made.bag"
    messages = list(recorded())
    topics = {topic: TopicType(message.type_name) for topic, _, message in messages}
    with open_recorder(str(path), topics) as recorder:
        for topic, stamp_ns, message in messages:
            recorder.write(topic, message, stamp_ns)
    return path


def test_every_message_comes_as_it_was_recorded(bag, start, hear):
    static, clock = hear("/tf_static", TFMessage), hear("/clock", Clock)
    player = start("player", f"_path:={bag}", "_rate:=4", "_wait_for:=/pose /tf_static", wait=False)
    assert clock.wait()[0].clock.to_nsec() == START  # it waits for who is to hear all
    poses = hear("/pose", PoseStamped)
    heard = poses.wait(COUNT)
    assert [pose.pose.position.x for pose in heard] == list(range(COUNT))
    stamps = [pose.header.stamp.to_nsec() for pose in heard]
    assert stamps == [START + i * S // 20 for i in range(COUNT)]
    assert player.wait(60) == 0
    own = [one for one in static.wait(1) if "player" in one._connection_header["callerid"]]
    children = {one.child_frame_id for message in own for one in message.transforms}
    assert children == {"camera", "imu"}
    times = [message.clock.to_nsec() for message in clock.messages]
    assert times == sorted(times)
    assert START <= times[0] <= times[-1] <= START + S


def test_images_take_the_place_of_a_camera(bag, start, hear):
    images, infos = hear("/image_raw", Image), hear("/camera_info", CameraInfo)
    compressed = hear("/cam/image_raw", Image)
    start("player", f"_path:={bag}", "_image:=first", "_loop:=true", wait=False)
    image = images.wait()[-1]
    value = round((image.header.stamp.to_nsec() - START) / (S // 20))
    assert (image.encoding, image.width, image.data) == ("bgr8", 16, bytes([value]) * 12 * 16 * 3)
    assert infos.wait()[-1].K[0] == 50
    assert not compressed.messages


@pytest.mark.parametrize("image", ["none", "first"])
def test_a_recording_without_images_waits_for_nobody_to_take_them(start, hear, recordings, image):
    bag = recordings / "bags" / "evo_ROS_example.bag"
    clock = hear("/clock", Clock)
    given = f"_image:={image}", "_wait_for:=image_raw", "_rate:=100"
    player = start("player", f"_path:={bag}", *given, wait=False)
    assert len({message.clock.to_nsec() for message in clock.wait(50)}) > 10
    assert player.poll() is None


def test_what_is_recorded_of_it_is_the_recording(bag, start, ros_master, tmp_path):
    """Its bytes with the stock recorder and reader, from a file of ROS 1."""
    copy = tmp_path / "copy.bag"
    count = sum(topic == "/pose" for topic, _, _ in recorded())
    record = ("rosbag", "record", "-O", str(copy), "-l", str(count), "/pose")
    with running(ros_master, *record) as recorder:
        start("player", f"_path:={bag}", "_wait_for:=/pose", wait=False)
        recorder.communicate(timeout=60)
    with rosbag.Bag(str(copy)) as read, rosbag.Bag(str(bag)) as source:
        made = [message for _, message, _ in read.read_messages("/pose", raw=True)]
        given = [message for _, message, _ in source.read_messages("/pose", raw=True)]
        times = [time.to_nsec() for _, _, time in source.read_messages("/pose")]
    assert [one[0] for one in made] == ["geometry_msgs/PoseStamped"] * count
    assert [(one[1], one[2]) for one in made] == [(one[1], one[2]) for one in given]
    assert times == [START + i * S // 20 for i in range(count)]


def test_a_recording_of_ros_2_comes_in_the_types_of_ros_1(start, hear, tmp_path):
    path = tmp_path / "made.mcap"
    messages = list(recorded())
    topics = {topic: TopicType(message.type_name) for topic, _, message in messages}
    with open_recorder(str(path), topics) as recorder:
        for topic, stamp_ns, message in messages:
            recorder.write(topic, message, stamp_ns)
    poses, infos = hear("/pose", PoseStamped), hear("/cam/camera_info", CameraInfo)
    start("player", f"_path:={path}", "_loop:=true", "_rate:=0.5", wait=False)
    pose = poses.wait()[0]
    number = round((pose.header.stamp.to_nsec() - START) / (S // 20))
    assert (pose.header.frame_id, pose.pose.position.x) == ("map", number)
    info = infos.wait()[0]
    assert (info.width, info.K[0], info.K[2]) == (16, 50, 8)


def test_a_kitti_folder_is_played(start, hear, recordings):
    drive = recordings / "kitti" / "drive0009_f000-004"
    clouds, images = hear("/velodyne_points", PointCloud2), hear("/image_raw", Image)
    odometry, static = hear("/odom", Odometry), hear("/tf_static", TFMessage)
    start("player", f"_path:={drive}", "_image:=/cam02/image_rect", "_loop:=true", wait=False)
    cloud = clouds.wait()[0]
    assert cloud.header.frame_id == "velodyne"
    assert [field.name for field in cloud.fields][:4] == ["x", "y", "z", "intensity"]
    assert 110_000 < cloud.width * cloud.height < 125_000
    image = images.wait()[0]
    assert (image.width, image.height, image.header.frame_id) == (1242, 375, "cam02_optical")
    assert odometry.wait()[0].child_frame_id == "base_link"

    def frames():  # among those that other tests have left
        return {one.child_frame_id for message in static.messages for one in message.transforms}

    wait_for(lambda: {"velodyne", "cam02_optical"} <= frames(), "its frames")


def test_who_comes_late_gets_all_that_holds(bag, start, hear):
    start("player", f"_path:={bag}", "_loop:=true", "_rate:=0.2")
    heard = hear("/tf_static", TFMessage)
    both = {"camera", "imu"}  # at once, or the second when it is played
    wait_for(lambda: {one.child_frame_id for one in heard.wait()[-1].transforms} == both, "both")


def test_what_is_not_there_is_said(bag, start):
    cases = {
        "_path:=/no/such.bag": "no such",
        "_image:=/front": "image=/front: no such image topic; choose from /cam/image_raw",
        "_topics:=/scan": "no topic /scan; choose from /cam/camera_info",
        "_wait_for:=/scan": "no such topic: /scan",
    }
    for number, (argument, words) in enumerate(cases.items()):
        given = [argument] if argument.startswith("_path") else [f"_path:={bag}", argument]
        player = start("player", *given, f"__name:=player_{number}", wait=False)
        assert player.wait(60) == 2
        assert words in end(player)


def test_an_action_is_a_service(start, hear, ros_master):
    start("path")
    publisher = rospy.Publisher("/pose", PoseStamped, queue_size=10)
    from nav_msgs.msg import Path as PathMessage

    paths = hear("/path", PathMessage)
    wait_for(lambda: publisher.get_num_connections(), "path to listen")
    for i in range(3):
        pose = PoseStamped()
        pose.header.frame_id, pose.header.stamp = "map", rospy.Time(100 + i)
        pose.pose.position.x, pose.pose.orientation.w = float(i), 1.0
        publisher.publish(pose)
        wait_for(lambda i=i: paths.messages and len(paths.messages[-1].poses) == i + 1, "a pose")
    answer = rospy.ServiceProxy("/path/clear", Trigger)()
    assert answer.success
    wait_for(lambda: not paths.messages[-1].poses, "an empty path")
    publisher.unregister()


def test_a_truncated_recording_is_played_as_far_as_it_goes_and_the_player_ends_with_1(
    tmp_path, bag, start
):
    part = tmp_path / "part.bag"
    part.write_bytes(bag.read_bytes()[: bag.stat().st_size * 2 // 3])
    player = start("player", f"_path:={part}", "_rate:=20", wait=False)
    said = player.communicate(timeout=60)[0]
    assert "[WARN]" in said
    assert player.returncode == 1
