"""The node `visual_odometry` on a drawn flight: metres, losses, and nothing without a scale."""

from dataclasses import replace

import numpy as np
import pytest
from visual_flight import HEIGHT, Flight, felt, place

from ros_visualise.data import Header, Image, Level, Transforms, TransformStamped
from ros_visualise.estimation.inertial.lens import LensErrors
from ros_visualise.geometry import rotations, se3
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.nodes.visual_odometry import CameraMotionParams, VisualOdometryNode

PERIOD_NS = 100_000_000


def answers(params, images):
    """The node's answers to images of a camera that is placed on the robot by tf."""
    flight, frames = Flight(), FrameTree()
    quat = rotations.from_matrix(flight.R(0))
    place = TransformStamped("camera", np.zeros(3), quat, Header(0, "base_link"))
    frames.add(Transforms((place,)), True)
    node = VisualOdometryNode(params)
    found = []
    for number, pixels in enumerate(images):
        header = Header(number * PERIOD_NS, "camera")
        image = Image(pixels, "mono8", header, camera_info=flight.info)
        found.append(node.step(params, image=image, frames=frames))
    return found


@pytest.fixture(scope="module")
def images():
    return [Flight().image(number) for number in range(14)]


def test_publishes_metres_and_reports_a_loss(images):
    flight, dark = Flight(), np.zeros_like(images[0])
    params = CameraMotionParams(height=HEIGHT, corners=120)
    found = answers(params, [*images, dark, dark])
    odometry = found[13]["odometry"]
    T_first_last = se3.from_parts(*flight.motion(0, 13))
    T_base_camera = se3.from_parts(flight.R(0), np.zeros(3))
    true = (T_base_camera @ T_first_last @ se3.inverse(T_base_camera))[:3, 3]
    assert np.linalg.norm(odometry.position_xyz - true) < 0.05 * np.linalg.norm(true)
    assert odometry.linear_xyz[0] == pytest.approx(1.2, rel=0.1)
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("visual_odom", "base_link")
    assert np.linalg.eigvalsh(odometry.pose_covariance).min() > 0
    assert found[13]["diagnostics"].statuses[0].message == "located"
    assert found[13]["debug_image"].pixels.shape == (240, 320, 3)
    points = next(one["points"] for one in reversed(found) if "points" in one)
    assert np.abs(points.xyz[:, 2] + HEIGHT).max() < 0.2
    lost = found[15]["odometry"]
    assert np.trace(lost.pose_covariance) > np.trace(odometry.pose_covariance)
    assert lost.twist_covariance[0, 0] > 1e3
    assert found[15]["diagnostics"].statuses[0].message == "too dark"


def test_publishes_no_odometry_without_a_scale(images):
    found = answers(CameraMotionParams(corners=120), images[:6])
    assert not any("odometry" in one or "points" in one or "tf" in one for one in found)
    assert "scale unknown" in found[-1]["diagnostics"].statuses[0].message


def answers_with_imu(seconds, gap=(9.0, 9.0), dark=()):
    """The node's answers to images at 10 Hz, and an IMU at 100 Hz with a gap."""
    flight, frames = Flight(), FrameTree()
    quat = rotations.from_matrix(flight.R(0))
    for name in ("camera", "imu"):
        mounted = TransformStamped(name, np.zeros(3), quat, Header(0, "base_link"))
        frames.add(Transforms((mounted,)), True)
    params, found = CameraMotionParams(corners=120), []
    node = VisualOdometryNode(params)
    for n in range(round(seconds * 100)):
        if not gap[0] < n / 100 < gap[1]:
            answer = node.step(params, imu=felt(flight, n / 100), frames=frames)
            found += [answer] if answer else []
        if n % 10 == 0 and n:
            pixels = flight.image(place(n / 100)) * np.uint8(n / 100 not in dark)
            image = Image(pixels, "mono8", Header(n * 10**7, "camera"), camera_info=flight.info)
            answer = node.step(params, image=image, frames=frames)
            found += [answer] if answer else []
    return found


def test_a_lens_that_the_images_contradict_is_reported(monkeypatch, caplog):
    monkeypatch.setattr(LensErrors, "fault", lambda *_: "the images fit another lens")
    status = answers_with_imu(1.2)[-1]["diagnostics"].statuses[0]
    assert (status.level, status.message) == (Level.WARN, "the images fit another lens")
    assert dict(status.values)["focal length"] == "260 px, +-8"
    assert caplog.text.count("the images fit another lens") == 1


def test_an_imu_gives_metres_after_a_rest():
    flight = Flight()
    found = [one for one in answers_with_imu(2.85, dark=(2.3, 2.4)) if "odometry" in one]
    last, stamps = found[-1]["odometry"], [one["odometry"].header.stamp_ns for one in found]
    assert stamps[0] == 700_000_000
    assert stamps == sorted(set(stamps))
    true = flight.p(place(last.header.stamp_ns / 1e9)) - flight.p(0)
    assert np.linalg.norm(last.position_xyz - true) < 0.02 * np.linalg.norm(true)
    assert last.linear_xyz[0] == pytest.approx(1.2, rel=0.05)
    assert (last.header.frame_id, last.child_frame_id) == ("visual_odom", "base_link")
    assert np.linalg.eigvalsh(last.pose_covariance).min() > 0
    reasons = [one["diagnostics"].statuses[0].message for one in found]
    assert reasons.count("too dark") == 2
    readout = dict(found[-1]["diagnostics"].statuses[0].values)["readout"]  # of a global shutter
    shown_ms, sigma_ms = (float(one.removesuffix(" ms")) for one in readout.split(", +-"))
    assert abs(shown_ms) < 3 * sigma_ms
    assert sigma_ms < 10
    assert found[0]["debug_image"].pixels.shape == (240, 320, 3)


def test_a_gap_of_the_imu_is_reported_and_its_covariance_grows():
    found = answers_with_imu(2.5, gap=(1.5, 1.9))
    assert dict(found[-1]["diagnostics"].statuses[0].values)["gaps"] == "1"
    covariances = [np.trace(one["odometry"].pose_covariance) for one in found if "odometry" in one]
    assert covariances[-1] > 10 * covariances[3]
    assert "waiting for the robot to rest" in found[-1]["diagnostics"].statuses[0].message


class Beside(Flight):
    """The right camera of a stereo pair."""

    def p(self, n):
        return super().p(n) + 0.2 * self.R(n)[:, 0]


def paired(baseline, count=8):
    """The node's answers to a stereo pair, whose right images come first and 5 ms late."""
    flight, beside, frames = Flight(), Beside(), FrameTree()
    node, params, found = VisualOdometryNode(CameraMotionParams()), CameraMotionParams(), []
    P = np.column_stack([flight.info.K, [-baseline * flight.info.K[0, 0], 0, 0]])
    for n in range(count):
        stamp_ns = (n + 1) * PERIOD_NS
        late = Header(stamp_ns + 5_000_000, "right")
        right = Image(beside.image(n), "mono8", late, camera_info=replace(flight.info, P=P))
        left = Image(flight.image(n), "mono8", Header(stamp_ns, "left"), camera_info=flight.info)
        found.append(node.step(params, right=right, frames=frames))
        found.append(node.step(params, image=left, frames=frames))
    return found


def test_a_stereo_pair_gives_metres_at_once():
    answers = paired(0.2)
    assert answers[::2] == [None] * 8
    found = [one["odometry"] for one in answers[1::2]]
    assert [one.header.stamp_ns for one in found] == [(n + 1) * PERIOD_NS for n in range(8)]
    true = np.linalg.norm(Flight().motion(0, 7)[1])
    assert np.linalg.norm(found[-1].position_xyz) == pytest.approx(true, rel=0.02)


def test_a_right_camera_without_a_place_gives_no_odometry():
    assert not any(one and "odometry" in one for one in paired(0.0, 2))
