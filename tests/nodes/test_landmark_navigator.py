"""The node that tells where the robot is: its messages, its map, and what it says."""

from dataclasses import replace

import numpy as np
import pytest

from ros_visualise.core.errors import NoTransform, OpenError, UsageError
from ros_visualise.data import (
    CameraInfo,
    Detection,
    Detections,
    Header,
    Hypothesis,
    Imu,
    Level,
    NavSatFix,
    Odometry,
    Transforms,
    TransformStamped,
)
from ros_visualise.estimation.landmark_map import MapMode
from ros_visualise.estimation.localization import map_file
from ros_visualise.estimation.localization.estimate import known
from ros_visualise.estimation.localization.track import Branch, LandmarkTrack
from ros_visualise.estimation.params import NavigatorParams
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.geometry.rotations import from_matrix
from ros_visualise.nodes.landmark_navigator import LandmarkNavigator

S = 1_000_000_000
DOWN = np.diag([1.0, -1.0, -1.0])
LEVEL = np.array([0.0, 0, 0, 1])
INFO = CameraInfo(640, 480, K=np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]]))
PLACES = {3: (2.0, 1.0), 4: (3.0, -1.0)}
SIDE = 0.5
NOISE = np.diag([1e-3, 1e-3, 1e-2, 1e-2, 1e-2, 1e-4])


def tree():
    """A camera that looks down from the robot's own place."""
    frames = FrameTree()
    mounted = TransformStamped("camera", np.zeros(3), from_matrix(DOWN), Header(0, "base_link"))
    frames.add(Transforms((mounted,)), static=True)
    return frames


def test_it_begins_where_a_frame_says_that_odom_started():
    frames = tree()
    started = TransformStamped("odom_start", np.array([3.0, 4, 0]), LEVEL, Header(0, "map"))
    frames.add(Transforms((started,)), static=True)
    node = LandmarkNavigator(NavigatorParams())
    odometry = Odometry(np.zeros(3), LEVEL, child_frame_id="base_link", header=Header(S, "odom"))
    (odom,) = node.step(NavigatorParams(), odometry=odometry, frames=frames)["tf"].transforms
    assert (odom.header.frame_id, odom.child_frame_id) == ("map", "odom")
    assert np.allclose(odom.translation_xyz, [3, 4, 0])


def written_map(path, common=None):
    sigma2 = np.eye(6) * 1e-6 + (np.zeros((6, 6)) if common is None else common)
    tracks = [
        LandmarkTrack(
            f"tag36h11_{id}",
            id,
            True,
            (Branch(known(np.array([*at, 0.0]), np.eye(3), sigma2), 0.0),),
            0,
            size_xyz=np.array([SIDE, SIDE, 0]),
            sizes=9,
            seen=9,
        )
        for id, at in PLACES.items()
    ]
    path.write_text(map_file.to_text("map", tracks, common))
    return str(path)


def odometry(time_s, x):
    return Odometry(
        np.array([x, 0.0, 0.0]),
        LEVEL,
        child_frame_id="base_link",
        header=Header(round(time_s * S), "odom"),
    )


def detections(time_s, robot_xyz, corners=True):
    """What a robot at (x, y, z) of the map that heads along x sees of the tags below it."""
    found = []
    for id, at in PLACES.items():
        center = DOWN.T @ (np.array([*at, 0.0]) - robot_xyz)
        square = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * SIDE / 2
        seen = center + square @ DOWN
        seen = seen @ INFO.K.T
        pixels = seen[:, :2] / seen[:, 2:] + 1e-4 * time_s  # no two images are the same
        hypothesis = Hypothesis(f"tag36h11_{id}", 1.0, center, from_matrix(DOWN.T), NOISE, id)
        one = Detection.of_corners(pixels, [hypothesis], str(id))
        found.append(replace(one, side_m=SIDE))
        if not corners:
            found[-1] = replace(one, corners_uv=np.zeros((0, 2)))
    return Detections(tuple(found), Header(round(time_s * S), "camera"), INFO if corners else None)


def run(node, params, corners=True, count=20):
    """The robot flies along x, 5 m above; its odometry begins at (1, 0, 5) of the map."""
    answers = []
    for number in range(count):
        time_s, x = 1 + number / 10, number / 20
        answers.append(node.step(params, odometry=odometry(time_s, x), frames=tree()))
        seen = detections(time_s, np.array([1.0 + x, 0, 5]), corners)
        answers.append(node.step(params, detections=seen, frames=tree()))
    return [answer for answer in answers if answer]


@pytest.fixture
def params(tmp_path):
    path = written_map(tmp_path / "map.yaml")
    return NavigatorParams(mode=MapMode.FROZEN, map=path, level_sigma=0.1)


@pytest.mark.parametrize("corners", [True, False], ids=["corners", "poses"])
def test_map_to_odom_and_the_pose_are_stamped_as_the_odometry(params, corners):
    answers = run(LandmarkNavigator(params), params, corners)
    last = [answer for answer in answers if "tf" in answer][-1]
    (frame,) = last["tf"].transforms
    assert (frame.header.frame_id, frame.child_frame_id) == ("map", "odom")
    assert frame.header.stamp_ns == last["pose"].header.stamp_ns == round(2.9 * S)
    np.testing.assert_allclose(frame.translation_xyz, [1, 0, 5], atol=0.03)
    np.testing.assert_allclose(last["pose"].position_xyz, [1.95, 0, 5], atol=0.03)
    sigma = np.sqrt(np.diag(last["pose"].covariance)[:3])
    assert (sigma > 0.0005).all()
    assert (sigma < 0.1).all()


def test_a_map_in_the_frame_of_the_odometry_is_renamed_and_saved_so(tmp_path, caplog):
    path = tmp_path / "map.yaml"
    written_map(path)
    path.write_text(path.read_text().replace("frame_id: map", "frame_id: odom"))
    params = NavigatorParams(mode=MapMode.FROZEN, map=str(path), save_to=str(tmp_path / "new.yaml"))
    node = LandmarkNavigator(params)
    last = [answer for answer in run(node, params) if "pose" in answer][-1]
    (frame,) = last["tf"].transforms
    assert (frame.header.frame_id, frame.child_frame_id) == ("map", "odom")
    assert last["pose"].header.frame_id == "map"
    said = [one.getMessage() for one in caplog.records if "frame odom is also" in one.getMessage()]
    assert len(said) == 1
    node.save_map(params)
    assert map_file.load(tmp_path / "new.yaml").frame_id == "map"


def test_odometry_in_the_frame_of_the_map_is_said_and_gets_no_transform(params, caplog):
    node = LandmarkNavigator(params)
    for number in range(20):
        one = odometry(1 + number / 10, number / 20)
        one = replace(one, header=replace(one.header, frame_id="map"))
        answer = node.step(params, odometry=one, frames=tree())
        seen = detections(1 + number / 10, np.array([1.0 + number / 20, 0, 5]))
        node.step(params, detections=seen, frames=tree())
    assert "pose" in answer
    assert "tf" not in answer
    assert caplog.text.count("publish the odometry in another frame, such as odom") == 1


def test_what_a_whole_map_is_off_the_robot_is_off_too(tmp_path):
    common = np.diag([0.3, 0.2, 0.1, 0, 0, 0]) ** 2
    path = written_map(tmp_path / "map.yaml", common)
    params = NavigatorParams(mode=MapMode.FROZEN, map=path, level_sigma=0.1)
    answers = run(LandmarkNavigator(params), params)
    sigma = np.sqrt(np.diag([a for a in answers if "pose" in a][-1]["pose"].covariance)[:3])
    np.testing.assert_allclose(sigma, [0.3, 0.2, 0.1], rtol=0.1)
    landmark = [a for a in answers if "landmarks" in a][-1]["landmarks"].detections[0]
    np.testing.assert_allclose(landmark.hypotheses[0].covariance, common, atol=1e-5)


def test_it_reports_what_it_uses_and_rejects(params):
    node = LandmarkNavigator(params)
    told = [answer for answer in run(node, params) if "diagnostics" in answer]
    (status,) = told[-1]["diagnostics"].statuses
    assert (status.level, status.values["located"]) == (Level.OK, "True")
    assert status.values["used"] == "tag36h11_3, tag36h11_4"
    (first,) = told[0]["diagnostics"].statuses
    assert (first.level, first.message) == (
        Level.ERROR,
        "not localized: needs one map tag in three images",
    )
    wrong = detections(3.0, np.array([2.0, 0, 5]))
    wrong = replace(wrong, detections=(wrong.detections[0], wrong.detections[0]))
    node.step(params, odometry=odometry(3.0, 1.0), frames=tree())
    answer = node.step(params, detections=wrong, frames=tree())
    (status,) = answer["diagnostics"].statuses
    assert status.values["rejected tag36h11_3"] == "duplicate in the image"
    assert "markers" not in answer, "the step of an image is long enough"
    answer = node.step(params, odometry=odometry(3.1, 1.0), frames=tree())
    label = next(m for m in answer["markers"].markers if "duplicate" in m.text)
    assert label.color_rgba[0] > 0.9 > 0.2 > label.color_rgba[1]
    assert {m.ns for m in answer["markers"].markers} == {"robot", "plate", "error", "label"}
    assert "markers" not in node.step(params, odometry=odometry(3.2, 1.0), frames=tree())


def test_landmarks_are_told_with_covariance(params):
    told = [answer for answer in run(LandmarkNavigator(params), params) if "landmarks" in answer]
    found = {one.id: one for one in told[-1]["landmarks"].detections}
    assert found.keys() == {"tag36h11_3", "tag36h11_4"}
    np.testing.assert_allclose(found["tag36h11_4"].position_xyz, [3, -1, 0], atol=1e-3)
    covariance = found["tag36h11_4"].hypotheses[0].covariance
    np.testing.assert_allclose(covariance, np.eye(6) * 1e-6, atol=1e-9)


def test_a_map_is_built_saved_and_navigated_by(tmp_path, caplog):
    path = tmp_path / "built.yaml"
    params = NavigatorParams(save_to=str(path), level_sigma=0.1, corner_floor=0.1, camera_turn=0.0)
    node = LandmarkNavigator(params)
    node.save_map(params)
    assert "nothing saved" in caplog.text
    run(node, params, count=40)
    node.save_map(params)
    frame_id, tracks, common = map_file.load(path)
    assert frame_id == "map"
    # of what both are off together, most is how level the map lies
    assert np.sqrt(common[[3, 4], [3, 4]]) == pytest.approx(np.radians(0.1), rel=0.3)
    assert sorted(track.name for track in tracks) == ["tag36h11_3", "tag36h11_4"]
    # the map begins where the odometry does
    np.testing.assert_allclose(tracks[0].best.position_xyz, [1, 1, -5], atol=0.1)
    frozen = NavigatorParams(mode=MapMode.FROZEN, map=str(path), level_sigma=0.1)
    last = [a for a in run(LandmarkNavigator(frozen), frozen) if "pose" in a][-1]
    np.testing.assert_allclose(last["pose"].position_xyz, [0.95, 0, 0], atol=0.1)


def test_other_parameters_hold_at_once_and_another_map_begins_anew(params, tmp_path):
    node = LandmarkNavigator(params)
    run(node, params)
    assert node.report()["landmarks"] == 2
    slower = replace(params, delay=1.0)
    node.step(slower, odometry=odometry(3.0, 1.0), frames=tree())
    assert node.report()["landmarks"] == 2
    other = replace(params, mode=MapMode.BUILD)
    node.step(other, odometry=odometry(3.1, 1.05), frames=tree())
    assert node.report()["landmarks"] == 0


def test_a_camera_whose_place_is_not_known_is_said(params):
    node = LandmarkNavigator(params)
    node.step(params, odometry=odometry(1.0, 0.0), frames=tree())
    with pytest.raises(NoTransform):
        node.step(params, detections=detections(1.0, np.array([1.0, 0, 5])), frames=FrameTree())


def test_without_a_map_only_a_new_one_can_be_built():
    with pytest.raises(OpenError, match="mode frozen needs a map; set the parameter 'map' to"):
        LandmarkNavigator(NavigatorParams(mode=MapMode.FROZEN))


def test_after_a_jump_of_time_it_begins_where_the_odometry_began():
    """Its own map -> odom took the place of the one that told that."""
    node, frames = LandmarkNavigator(NavigatorParams()), tree()
    began = TransformStamped("odom", np.array([-6.0, -3, 0]), LEVEL, Header(0, "map"))
    frames.add(Transforms((began,)), static=True)
    node.step(NavigatorParams(), odometry=odometry(1, 0), frames=frames)
    node.reset()
    answer = node.step(NavigatorParams(), odometry=odometry(9, 0), frames=tree())
    (frame,) = answer["tf"].transforms
    np.testing.assert_allclose(frame.translation_xyz, [-6, -3, 0], atol=1e-9)


def test_an_image_after_a_jump_of_time_waits_for_an_odometry(tmp_path):
    params = NavigatorParams(save_to=str(tmp_path / "built.yaml"))
    node = LandmarkNavigator(params)
    run(node, params, count=40)
    assert node.report()["landmarks"] == 2
    node.reset()
    assert node.step(params, detections=detections(1, np.array([1.0, 0, 5])), frames=tree()) is None
    node.save_map(params)
    assert len(map_file.load(tmp_path / "built.yaml")[1]) == 2  # what was built is kept


def test_losses_are_no_loss_of_data():
    """What a node reports as ``lost`` is what it could not read."""
    node = LandmarkNavigator(NavigatorParams())
    node.step(NavigatorParams(), odometry=odometry(1, 0), frames=tree())
    assert "lost" not in node.report()


def imu(time_s, frame="imu_link", **covariances):
    force = np.array([0, 0, 9.80665])
    return Imu(LEVEL, np.zeros(3), force, header=Header(round(time_s * S), frame), **covariances)


def values(node, params, frames=None):
    """What the diagnostics say, after an image."""
    frames = frames or tree()
    node.step(params, odometry=odometry(4.0, 1.0), frames=frames)
    seen = detections(4.0, np.array([2.0, 0, 5]))
    (status,) = node.step(params, detections=seen, frames=frames)["diagnostics"].statuses
    return status.values


def test_an_imu_is_used_where_its_place_is_known(params):
    frames, node = tree(), LandmarkNavigator(params)
    turned = np.array([1.0, 0, 0, 0])  # upside down
    mounted = TransformStamped("imu_link", np.zeros(3), turned, Header(0, "base_link"))
    frames.add(Transforms((mounted,)), static=True)
    run(node, params)
    for number in range(200):
        down = Imu(
            LEVEL,
            np.zeros(3),
            np.array([0, 0, -9.80665]),
            header=Header(round((3 + number / 200) * S), "imu_link"),
        )
        node.step(params, imu=down, frames=frames)
        if number % 10 == 9:
            told = odometry(3 + number / 200, 0.95)
            answer = node.step(params, odometry=told, frames=frames)
    assert values(node, params, frames)["imu"] == "used"
    np.testing.assert_allclose(answer["pose"].position_xyz, [1.95, 0, 5], atol=0.1)


def test_an_imu_that_nobody_placed_is_left_out_and_said_once(params, caplog):
    node = LandmarkNavigator(params)
    run(node, params)
    for number in range(5):
        node.step(params, imu=imu(3 + number / 100), frames=tree())
    assert sum("ignoring imu until" in record.getMessage() for record in caplog.records) == 1
    assert values(node, params)["imu"] == "none"


def test_an_imu_that_measures_no_accelerations_is_none(params):
    node = LandmarkNavigator(params)
    run(node, params)
    nothing = np.diag([-1.0, 0, 0])
    node.step(params, imu=imu(3, "base_link", linear_covariance=nothing), frames=tree())
    assert values(node, params)["imu"] == "none"


def test_fixes_are_counted_and_no_fix_is_none(tmp_path):
    params = NavigatorParams(gps_origin="49, 8.4, 5")
    node = LandmarkNavigator(params)

    def fix(time_s, longitude, status=0):
        header = Header(round(time_s * S), "base_link")
        return NavSatFix(49.0, longitude, 5.0, np.eye(3), 2, status, header=header)

    started = TransformStamped("odom_start", np.zeros(3), LEVEL, Header(0, "map"))
    frames = tree()
    frames.add(Transforms((started,)), static=True)
    node.step(params, odometry=odometry(1, 0), frames=frames)
    for number in range(1, 20):
        node.step(params, gps=fix(1 + number / 10, 8.4), frames=tree())
        node.step(params, gps=fix(1 + number / 10, 9.4, status=-1), frames=tree())
        node.step(params, odometry=odometry(1 + number / 10, 0), frames=tree())
    node.step(params, gps=fix(3, 9.4), frames=tree())
    said = values(node, params)
    assert (said["gps used"], said["gps rejected"]) == ("19", "1")
    assert node.report()["gps: no fix"] == 19


@pytest.mark.parametrize("text", ["here", "49, 8.4", "91, 0, 0", "nan, 0, 0"])
def test_an_origin_that_is_no_place_is_refused(text):
    with pytest.raises(UsageError, match="give latitude, longitude, altitude"):
        LandmarkNavigator(NavigatorParams(gps_origin=text))


def test_another_who_tells_where_odom_is_gets_said(caplog):
    frames = tree()
    began = TransformStamped("odom", np.zeros(3), LEVEL, Header(0, "map"))
    frames.add(Transforms((began,)), static=True)
    params = NavigatorParams()
    LandmarkNavigator(params).step(params, odometry=odometry(1, 0), frames=frames)
    assert "another node already publishes map -> odom" in caplog.text


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda one: replace(one, side_m=0.3), "size 0.3 m, but 0.5 m in the map; check"),
        (lambda one: replace(one, corners_uv=one.corners_uv + 40), "has it moved?"),
    ],
    ids=["of another size", "moved"],
)
def test_a_tag_that_is_wrong_is_said_once(params, caplog, change, said):
    node = LandmarkNavigator(params)
    run(node, params)
    for number in range(20):
        time_s, x = 3 + number / 10, 1 + number / 20
        node.step(params, odometry=odometry(time_s, x), frames=tree())
        seen = detections(time_s, np.array([1 + x, 0, 5]))
        wrong, right = seen.detections
        seen = replace(seen, detections=(change(wrong), right))
        node.step(params, detections=seen, frames=tree())
    [line] = [record.getMessage() for record in caplog.records]
    assert "ignoring tag36h11_3" in line
    assert said in line


def test_a_camera_that_freezes_is_said_once(params, caplog):
    node = LandmarkNavigator(params)
    run(node, params)
    frozen = detections(2.9, np.array([1.95, 0, 5]))
    for number in range(20):
        node.step(params, odometry=odometry(3 + number / 10, 1.0), frames=tree())
        image = replace(frozen, header=Header(round((3 + number / 10) * S), "camera"))
        node.step(params, detections=image, frames=tree())
    [line] = [record.getMessage() for record in caplog.records]
    assert "is the camera frozen?" in line


@pytest.mark.parametrize("grows", [0.0, 0.04])
def test_an_odometry_that_does_not_know_its_velocity_counts_by_the_growth_of_its_pose(grows):
    node, frames, unknown = LandmarkNavigator(NavigatorParams()), tree(), np.eye(6) * 1e6
    for number in range(11):
        at = np.array([40.0, number / 10, 0])
        grown = np.diag([0, 0, 0, 0, 0, 1e-4])
        grown[:3, :3] = grows * number * np.eye(3)
        change = np.eye(6)
        change[:3, 3:] = [[0, at[2], -at[1]], [-at[2], 0, at[0]], [at[1], -at[0], 0]]
        one = replace(odometry(1 + number / 10, 0), position_xyz=at, twist_covariance=unknown)
        one = replace(one, pose_covariance=change @ grown @ change.T)
        found = node.step(NavigatorParams(), odometry=one, frames=frames)
    sigma = np.sqrt(np.diag(found["pose"].covariance)[:2])
    # a heading of 0.01 rad moves 40 m by 0.4, but does not grow
    assert sigma == pytest.approx(np.sqrt(grows * 10), abs=0.05)
