"""Terrain models as ground: a hill that is drawn to a GeoTIFF, in two reference systems."""

import numpy as np
import pytest
import rasterio
from rasterio.transform import from_origin

from ros_visualise.core.errors import OpenError
from ros_visualise.geometry.geodesy import LocalPlane
from ros_visualise.landmarks.georeferencing.terrain import TerrainSurface

PLACE = 46.84, 9.5


def write(path, crs="EPSG:4326", heights=None):
    """A slope of 1 in 10 to the north, 600 m high at the place, of 5 x 5 km."""
    if crs == "EPSG:4326":
        step = 0.0005
        north = PLACE[0] + 50 * step
        transform = from_origin(PLACE[1] - 50 * step, north, step, step)
        rows = north - step * (np.arange(100) + 0.5)
        values = (
            600
            + 0.1
            * LocalPlane(*PLACE).to_enu(
                np.stack([rows, np.full(100, PLACE[1]), np.zeros(100)], axis=1)
            )[:, 1]
        )
        values = np.repeat(values[:, None], 100, axis=1)
    else:
        transform = from_origin(535_000, 5_190_000, 30, 30)  # about there, in UTM zone 32
        values = np.full((200, 200), 700.0)
    values = values if heights is None else heights
    with rasterio.open(
        path,
        "w",
        driver="GTiff",
        width=values.shape[1],
        height=values.shape[0],
        count=1,
        dtype="float32",
        crs=crs,
        transform=transform,
    ) as model:
        model.write(values.astype(np.float32), 1)
    return path


def test_rays_meet_a_slope(tmp_path):
    ground = TerrainSurface(write(tmp_path / "hill.tif"), *PLACE, None)
    assert ground.base_m == pytest.approx(600, abs=0.01)
    origins = np.tile([0.0, 0, 110], (3, 1))
    level = np.array([0.0, 1, 0])  # meets the slope at 1100 m, where the plane would never
    down, back = np.array([0, 0, -1.0]), np.array([0, -0.8, -0.6])
    ahead, below, behind = ground.meet(origins, np.array([level, down, back]))
    np.testing.assert_allclose(ahead, [0, 1100, 110], atol=1.0)
    np.testing.assert_allclose(below, [0, 0, 0], atol=0.02)
    assert behind[2] == pytest.approx(0.1 * behind[1], abs=0.05)
    assert ground.lies_below(origins[0])
    assert not ground.lies_below(np.array([0, 500, 10.0]))


def test_rays_beyond_the_model_meet_nothing(tmp_path):
    ground = TerrainSurface(write(tmp_path / "hill.tif"), *PLACE, None)
    assert np.isnan(ground.meet(np.array([[0.0, 0, 300]]), np.array([[0, -1.0, 0]]))).all()


def test_models_in_other_reference_systems_are_read_with_the_height_that_is_given(tmp_path):
    place = 46.84, 9.48  # 36.6 km east of the central meridian
    ground = TerrainSurface(write(tmp_path / "utm.tif", "EPSG:32632"), *place, 650.0)
    (met,) = ground.meet(np.array([[0.0, 0, 300]]), np.array([[0, 0, -1.0]]))
    assert met[2] == pytest.approx(50, abs=0.01)


def test_what_is_no_model_of_the_place_is_one_line(tmp_path):
    hill = write(tmp_path / "hill.tif")
    (tmp_path / "bad.tif").write_bytes(b"II*\0 no picture")
    (tmp_path / "other.vrt").write_text("<VRTDataset/>")
    for path, place in {
        hill: (10.0, 10.0),
        tmp_path / "bad.tif": PLACE,
        tmp_path / "other.vrt": PLACE,
        tmp_path / "none.tif": PLACE,
    }.items():
        with pytest.raises(OpenError, match=path.name):
            TerrainSurface(path, *place, None)
