"""Images laid on the ground."""

import json

import cv2
import numpy as np
import pytest
import rasterio

from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import update
from ros_visualise.data import CameraInfo, Header, Image, NavSatFix, TransformStamped
from ros_visualise.geometry import rotations
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.geometry.geodesy import LocalPlane
from ros_visualise.landmarks.georeferencing.mosaic import Mosaic, footprint
from ros_visualise.nodes import find
from ros_visualise.nodes.mosaic import MosaicParams

K = np.array([[300.0, 0, 159.5], [0, 300, 119.5], [0, 0, 1]])
SIZE = (320, 240)
ORIGIN = 49.0, 8.4, 100.0
SPOTS = np.array([[0.0, 0], [12, 5], [-8, -6], [20, -3]])


def pose(x, y, z=20.0, yaw=0.0, tilt=0.0):
    """T_map_camera of one that looks down, and ``tilt`` radians ahead."""
    ahead = np.array([np.cos(yaw) * np.sin(tilt), np.sin(yaw) * np.sin(tilt), -np.cos(tilt)])
    right = np.array([np.sin(yaw), -np.cos(yaw), 0])
    T = np.eye(4)
    T[:3, :3] = np.stack((right, np.cross(ahead, right), ahead), axis=1)
    T[:3, 3] = x, y, z
    return T


def seen(T):
    """The image of gray ground with white spots."""
    pixels = np.full((SIZE[1], SIZE[0], 3), 90, np.uint8)
    for x, y in SPOTS:
        at = K @ T[:3, :3].T @ (np.array([x, y, 0]) - T[:3, 3])
        if at[2] > 0:
            u, v = (at[:2] / at[2] * 16).round().astype(int).tolist()
            cv2.circle(pixels, (u, v), 4 * 16, (255, 255, 255), -1, cv2.LINE_AA, shift=4)
    return pixels


POSES = [pose(x, y, 18 + y / 4, x / 9, 0.5) for x in range(-12, 26, 4) for y in (-6, 0, 6)]


def spots(pixels):
    """Centres of the white spots, in pixels."""
    _, _, stats, centers = cv2.connectedComponentsWithStats(cv2.inRange(pixels[..., 0], 180, 255))
    return centers[1:][stats[1:, 4] > 20]


def run(poses, frames_of=None, **changes):
    params = update(MosaicParams(), changes)
    node, tree, info = find("mosaic").make(params), FrameTree(), CameraInfo(SIZE[1], SIZE[0], K)
    node.step(params, map_origin=NavSatFix(*ORIGIN, header=Header(0, "map")), frames=tree)
    answers = []
    for number, T in enumerate(poses):
        header = Header(number * 500_000_000, "camera")
        quat, place = rotations.from_matrix(T[:3, :3]), T[:3, 3]
        tree.add(TransformStamped("camera", place, quat, Header(header.stamp_ns, "map")))
        image = Image(seen(T), "bgr8", header, info)
        answers.append(node.step(params, image=image, frames=tree))
    return node, answers


def test_the_file_has_things_where_they_are(tmp_path):
    path = tmp_path / "mosaic.tif"
    node, answers = run(POSES, save_to=str(path))
    node.finish()
    with rasterio.open(path) as file:
        assert (file.crs.to_epsg(), file.count) == (4326, 4)
        pixels = np.moveaxis(file.read(), 0, 2)
        found = [file.transform * (u + 0.5, v + 0.5) for u, v in spots(pixels)]
    assert (pixels[0, 0] == 0).all()  # empty, and transparent
    lon, lat = np.transpose(found)
    enu = LocalPlane(*ORIGIN).to_enu(np.column_stack((lat, lon, np.full(len(lat), 100.0))))
    off = np.linalg.norm(enu[:, None, :2] - SPOTS, axis=2)
    assert off.min(axis=0).max() < 0.2  # metres, of all spots
    assert off.min(axis=1).max() < 0.5  # nothing else
    assert node.report()["laid"] > 10
    sent = [json.loads(one["picture"].text) for one in answers if "picture" in one]
    assert sent[-1]["features"][0]["properties"]["image"].startswith("data:image/webp;base64,")
    assert len(sent) < len(answers) / 2


def test_the_footprint_of_an_image():
    down = footprint(K, SIZE, pose(3, 4), 0.0, 0.3)
    assert sorted(np.ptp(down[:, :2], axis=0)) == pytest.approx([16, 64 / 3])
    assert down.mean(axis=0) == pytest.approx([3, 4, 0])
    level = footprint(K, SIZE, pose(0, 0, tilt=np.pi / 2), 0.0, np.radians(20))
    assert level[:, 0].max() == pytest.approx(20 / np.tan(np.radians(20)))
    assert footprint(K, SIZE, pose(0, 0, tilt=2.5), 0.0, 0.3) is None
    assert footprint(K, SIZE, pose(0, 0, z=0.1), 0.0, 0.3) is None


def test_memory_is_bounded():
    mosaic = Mosaic(0.05, 20)
    for x in range(0, 400, 10):
        T = pose(x, 0)
        mosaic.add(seen(T), K, T, footprint(K, SIZE, T, 0.0, 0.3))
        assert len(mosaic) <= 20
    picture = mosaic.picture(1 << 16)
    assert picture.pixels.shape[0] * picture.pixels.shape[1] <= 1 << 16
    assert picture.east - picture.west == pytest.approx(410, abs=120)  # whole tiles
    assert mosaic.resolution_m > 0.05


def test_without_a_position_or_a_file():
    params = MosaicParams()
    node = find("mosaic").make(params)
    image = Image(seen(POSES[0]), "bgr8", Header(0, "camera"))
    assert node.step(params, image=image, frames=FrameTree()) is None
    node.finish()
    with pytest.raises(ParameterError, match="set save_to to a file name"):
        node.save_mosaic(params)
    with pytest.raises(ParameterError, match=r"ends in \.tif"):
        update(MosaicParams(), {"save_to": "mosaic.png"})
