"""Terrain models in files, such as GeoTIFF and SRTM's .hgt, as ground; the extra ``terrain``."""

from __future__ import annotations

from contextlib import ExitStack
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from ros_visualise.core.errors import OpenError
from ros_visualise.core.regular_files import open_file
from ros_visualise.data import Floats
from ros_visualise.geometry.geodesy import LocalPlane
from ros_visualise.landmarks.georeferencing.ground import curvature

_INSTALL = (
    "terrain models need rasterio; install it: pip install 'ros_visualise[terrain]' (in a clone:"
    " pip install '.[terrain]')"
)
_DRIVERS = {b"II*\0": "GTiff", b"MM\0*": "GTiff", b"II+\0": "GTiff", b"MM\0+": "GTiff"}
_DRIVERS |= {b"UHL1": "DTED", b"ncol": "AAIGrid", b"NCOL": "AAIGrid"}
"""First bytes of a file -> GDAL's driver; others may name further files or addresses to read."""
_SRTM = ".hgt"  # which has no head
_GEOGRAPHIC = "EPSG:4326"
_NO_DATA = -32768.0
_REACH_M = 20_000.0  # as far as rays are followed
_MOST_CELLS = 3000  # in a row
_DEGREE_M = 111_320.0
_RATIO = 1.02  # of the lengths of a ray at which it is compared with the ground
_NEAREST_M = 0.5
_HALVINGS = 24


class TerrainSurface:
    """The ground of a terrain model around a point.

    Args:
        path: a file that GDAL reads, with heights in metres in its first band.
        latitude, longitude: of the map's origin.
        base_m: height in the model's own datum at which the map's z is 0; None: the model's own at
            the origin.

    Raises:
        OpenError: the file is missing or damaged, or its heights do not reach the origin.
    """

    def __init__(self, path: Path, latitude: float, longitude: float, base_m: float | None) -> None:
        self._plane = LocalPlane(latitude, longitude)
        self._heights, self._north_west, self._cell = _read(path, latitude, longitude)
        at_origin = self._height(np.zeros((1, 2)))[0]
        if base_m is None and np.isnan(at_origin):
            raise OpenError(
                f"{path}: no heights at {latitude:.5f}, {longitude:.5f};"
                " give a terrain model of this area"
            )
        self.base_m = float(at_origin) if base_m is None else base_m
        steps = int(np.log(_REACH_M / _NEAREST_M) / np.log(_RATIO))
        self._lengths = _NEAREST_M * _RATIO ** np.arange(steps)

    def meet(self, origins_xyz: Floats, directions_xyz: Floats) -> Floats:
        """See `ros_visualise.landmarks.georeferencing.ground.Surface`."""
        points = origins_xyz[:, None] + self._lengths[:, None] * directions_xyz[:, None]
        above = self._above(points.reshape(-1, 3)).reshape(points.shape[:2])
        is_end = ~(above > 0)  # the ground, or the end of the model
        first = is_end.argmax(axis=1)
        rows = np.arange(len(points))
        met = np.full((len(points), 3), np.nan)
        found = (above[rows, first] <= 0) & (first > 0)
        if not found.any():
            return met
        rows, first = rows[found], first[found]
        near, far = self._lengths[first - 1], self._lengths[first]
        start, along = origins_xyz[rows], directions_xyz[rows]
        for _ in range(_HALVINGS):
            middle = (near + far) / 2
            is_over = self._above(start + middle[:, None] * along) > 0
            near, far = np.where(is_over, middle, near), np.where(is_over, far, middle)
        met[rows] = start + far[:, None] * along
        return met

    def lies_below(self, point_xyz: Floats) -> bool:
        """See `ros_visualise.landmarks.georeferencing.ground.Surface`."""
        return bool(self._above(point_xyz[None])[0] > 0)

    def _above(self, points_xyz: Floats) -> Floats:
        """(N,) heights of points above the ground; NaN outside of the model."""
        ground = self._height(points_xyz[:, :2]) - self.base_m - curvature(points_xyz[:, :2])
        return np.asarray(points_xyz[:, 2] - ground)

    def _height(self, xy: Floats) -> Floats:
        """(N,) the model's heights, linear between its cells' centres; NaN outside."""
        at = np.column_stack([xy, -curvature(xy)])
        places = self._plane.from_enu(at)[:, :2]
        row, column = ((places - self._north_west) / self._cell).T
        rows, columns = self._heights.shape
        inside = (row >= 0) & (row <= rows - 1) & (column >= 0) & (column <= columns - 1)
        row, column = np.where(inside, row, 0), np.where(inside, column, 0)
        i = np.minimum(row.astype(int), rows - 2)
        j = np.minimum(column.astype(int), columns - 2)
        v, u = row - i, column - j
        z = self._heights
        upper = z[i, j] * (1 - u) + z[i, j + 1] * u
        lower = z[i + 1, j] * (1 - u) + z[i + 1, j + 1] * u
        return np.where(inside, upper * (1 - v) + lower * v, np.nan)


def check_terrain(path: Path) -> str:
    """GDAL's driver for a file.

    Raises:
        OpenError: it is missing, or of another format, or rasterio is missing.
    """
    if find_spec("rasterio") is None:
        raise OpenError(f"{path}: {_INSTALL}")
    try:
        with open_file(path) as file:  # neither an address nor one of GDAL's virtual files
            driver = _DRIVERS.get(file.read(4))
    except OSError as error:
        raise OpenError.unreadable(path, error) from None
    if driver is None and path.suffix.lower() == _SRTM:
        driver = "SRTMHGT"
    if driver is None:
        raise OpenError(f"{path}: not a terrain model; give a GeoTIFF, .hgt, DTED or ASCII grid")
    return driver


def _read(path: Path, latitude: float, longitude: float) -> tuple[Floats, Floats, Floats]:
    """Heights around a point by rows from the north, the centre of the first, and the step."""
    driver = check_terrain(path)
    import rasterio
    from rasterio.errors import RasterioError
    from rasterio.vrt import WarpedVRT
    from rasterio.windows import Window, from_bounds

    reach = _REACH_M / _DEGREE_M
    wide = reach / max(np.cos(np.radians(latitude)), 0.01)
    bounds = (longitude - wide, latitude - reach, longitude + wide, latitude + reach)
    try:
        with ExitStack() as opened:
            model = opened.enter_context(rasterio.open(path.absolute(), driver=driver))
            nodata = _NO_DATA if model.nodata is None else model.nodata
            warped = opened.enter_context(WarpedVRT(model, crs=_GEOGRAPHIC, nodata=nodata))
            whole = Window(0, 0, warped.width, warped.height)
            window = from_bounds(*bounds, warped.transform).intersection(whole)
            window = window.round_offsets().round_lengths().intersection(whole)
            shape = tuple(max(2, min(int(n), _MOST_CELLS)) for n in (window.height, window.width))
            heights = warped.read(1, window=window, out_shape=shape, masked=True)
            transform: Any = warped.window_transform(window)
            step = [transform.e * window.height / shape[0], transform.a * window.width / shape[1]]
    except RasterioError as error:
        raise OpenError(f"{path}: no terrain model around the map's origin: {error}") from None
    cell = np.array(step)
    first = np.array([transform.f, transform.c]) + cell / 2
    return np.ma.filled(heights.astype(np.float64), np.nan), first, cell
