"""A mosaic: images laid on level ground one by one, by the poses of their camera.

It is kept in square tiles of pixels, whose number is bounded: where there are too many, all of them
are halved. A pixel is replaced by a newer one unless that is seen at a much flatter angle.
"""

from __future__ import annotations

import io
import math
from dataclasses import dataclass

import cv2
import numpy as np
from PIL import Image as PillowImage
from PIL import TiffImagePlugin

from ros_visualise.data import Floats, Pixels
from ros_visualise.geometry.geodesy import LocalPlane

_SIDE = 256  # pixels of a tile
_LARGEST = 4096  # pixels across an image on the ground
_NOTABLY = 30  # of 255, by which a flatter view is worse
_LEAST_HEIGHT_M = 0.2


@dataclass(frozen=True, eq=False)
class MosaicPicture:
    """The whole mosaic: ``pixels`` (H, W, 4) bgra8, north up.

    ``west``, ``south``, ``east`` and ``north`` are its edges in metres from the map's origin.
    """

    pixels: Pixels
    west: float
    south: float
    east: float
    north: float

    def bounds(self, plane: LocalPlane) -> tuple[float, float, float, float]:
        """Longitude and latitude of its edges: west, south, east, north."""
        x, y = (self.west + self.east) / 2, (self.south + self.north) / 2
        sides = [(self.west, y, 0), (x, self.south, 0), (self.east, y, 0), (x, self.north, 0)]
        west, south, east, north = plane.from_enu(sides)
        return float(west[1]), float(south[0]), float(east[1]), float(north[0])

    def geotiff(self, plane: LocalPlane) -> bytes:
        """A GeoTIFF in WGS 84 (EPSG:4326), with the empty part transparent.

        Source: OGC 19-008r4, GeoTIFF 1.1: ModelPixelScaleTag, ModelTiepointTag and
        GeoKeyDirectoryTag with GTModelType geographic, PixelIsArea, and EPSG 4326.
        """
        west, south, east, north = self.bounds(plane)
        height, width = self.pixels.shape[:2]
        tags = TiffImagePlugin.ImageFileDirectory_v2()
        for tag, kind, values in (
            (33550, 12, ((east - west) / width, (north - south) / height, 0.0)),
            (33922, 12, (0.0, 0.0, 0.0, west, north, 0.0)),
            (34735, 3, (1, 1, 0, 3, 1024, 0, 1, 2, 1025, 0, 1, 1, 2048, 0, 1, 4326)),
        ):
            tags.tagtype[tag] = kind
            tags[tag] = values
        file = io.BytesIO()
        picture = PillowImage.fromarray(cv2.cvtColor(self.pixels, cv2.COLOR_BGRA2RGBA))
        picture.save(file, "TIFF", tiffinfo=tags, compression="tiff_deflate")
        return file.getvalue()


class Mosaic:
    """Images on the plane z = ``ground_z`` of a map with x east, y north.

    Args:
        resolution_m: side of a pixel; 0: as fine as the first image.
        most_tiles: of 256 x 256 pixels, 256 KiB each.
    """

    def __init__(self, resolution_m: float = 0.0, most_tiles: int = 400) -> None:
        self.resolution_m = resolution_m
        self._most = most_tiles
        self._tiles: dict[tuple[int, int], Pixels] = {}  # column, row from the north; bgr, quality

    def __len__(self) -> int:
        return len(self._tiles)

    def add(self, bgr: Pixels, K: Floats, T_map_camera: Floats, ground: Floats) -> None:
        """Lay an image without distortion on the ground.

        Args:
            bgr: (H, W, 3) 8 bits.
            K: (3, 3) calibration.
            T_map_camera: 4x4, of the optical frame.
            ground: (N, 3) its `footprint`.
        """
        height = float(T_map_camera[2, 3] - ground[0, 2])
        self.resolution_m = self.resolution_m or height / float(K[0, 0])
        while np.ptp(ground[:, :2], axis=0).max() / self.resolution_m > _LARGEST:
            self._halve()
        bgr, K = _reduced(bgr, K, height / float(K[0, 0]) / self.resolution_m)
        low, high = ground[:, :2].min(axis=0), ground[:, :2].max(axis=0)
        step = self.resolution_m
        left, top = math.floor(low[0] / step), math.floor(-high[1] / step)
        width, rows = math.ceil(high[0] / step) - left, math.ceil(-low[1] / step) - top
        to_map = np.array(
            [[step, 0, (left + 0.5) * step], [0, -step, -(top + 0.5) * step], [0, 0, 1]]
        )
        R, position = T_map_camera[:3, :3].T, T_map_camera[:3, 3]
        down = np.array([0, 0, ground[0, 2]]) - position
        H = K @ np.column_stack((R[:, 0], R[:, 1], R @ down)) @ to_map
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        laid = cv2.warpPerspective(
            bgr, H, (width, rows), flags=flags, borderMode=cv2.BORDER_REPLICATE
        )
        outline = np.column_stack((ground[:, 0] / step - left, -ground[:, 1] / step - top)) - 0.5
        quality = _quality(to_map, position, height, (rows, width))
        mask = np.zeros((rows, width), np.uint8)
        cv2.fillConvexPoly(mask, outline.round().astype(np.int32), 1)
        self._merge(left, top, np.dstack((laid, quality * mask)))

    def picture(self, most_px: int) -> MosaicPicture | None:
        """The whole mosaic with at most so many pixels; None if it is empty."""
        if not self._tiles:
            return None
        columns, rows = zip(*self._tiles, strict=True)
        left, top = min(columns), min(rows)
        width, height = max(columns) + 1 - left, max(rows) + 1 - top
        step = 1
        while width * height * (_SIDE // step) ** 2 > most_px and step < _SIDE:
            step *= 2
        side = _SIDE // step
        pixels = np.zeros((height * side, width * side, 4), np.uint8)
        for (column, row), tile in self._tiles.items():
            x, y = (column - left) * side, (row - top) * side
            pixels[y : y + side, x : x + side] = tile[step // 2 :: step, step // 2 :: step]
        pixels[..., 3] = np.where(pixels[..., 3], 255, 0)
        metres = _SIDE * self.resolution_m
        west, north = left * metres, -top * metres
        return MosaicPicture(pixels, west, north - height * metres, west + width * metres, north)

    def _merge(self, left: int, top: int, laid: Pixels) -> None:
        bottom, right = top + laid.shape[0], left + laid.shape[1]
        for row in range(top // _SIDE, (bottom - 1) // _SIDE + 1):
            for column in range(left // _SIDE, (right - 1) // _SIDE + 1):
                x, y = column * _SIDE, row * _SIDE
                part = laid[max(y - top, 0) : y + _SIDE - top, max(x - left, 0) : x + _SIDE - left]
                if not part[..., 3].any():
                    continue
                tile = self._tiles.setdefault((column, row), np.zeros((_SIDE, _SIDE, 4), np.uint8))
                inner = tile[max(top - y, 0) : bottom - y, max(left - x, 0) : right - x]
                is_worse = part[..., 3].astype(np.int16) + _NOTABLY < inner[..., 3]
                is_new = (part[..., 3] > 0) & ~is_worse
                inner[is_new] = part[is_new]
        while len(self._tiles) > self._most:
            self._halve()

    def _halve(self) -> None:
        """Double the side of a pixel."""
        halved: dict[tuple[int, int], Pixels] = {}
        half = _SIDE // 2
        for (column, row), tile in self._tiles.items():
            at = column // 2, row // 2
            whole = halved.setdefault(at, np.zeros((_SIDE, _SIDE, 4), np.uint8))
            y, x = row % 2 * half, column % 2 * half
            whole[y : y + half, x : x + half] = tile[::2, ::2]
        self._tiles, self.resolution_m = halved, 2 * self.resolution_m


def footprint(
    K: Floats, size: tuple[int, int], T_map_camera: Floats, ground_z: float, least_rad: float
) -> Floats | None:
    """The part of the ground that an image shows: corners (N, 3), N > 2; None for none.

    Args:
        K: (3, 3) calibration; lens distortion is ignored.
        size: width and height, pixels.
        T_map_camera: 4x4, of the optical frame.
        ground_z: height of the ground in the map, metres.
        least_rad: least angle below the horizon, straight ahead.
    """
    height = T_map_camera[2, 3] - ground_z
    if height < _LEAST_HEIGHT_M:
        return None
    edges = np.array([size]) - 0.5
    corners = np.array([[-0.5, -0.5], [edges[0, 0], -0.5], edges[0], [-0.5, edges[0, 1]]])
    rays = np.column_stack((corners, np.ones(4))) @ np.linalg.inv(K).T @ T_map_camera[:3, :3].T
    ahead = T_map_camera[:2, 2]
    ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-9)
    above = -rays[:, 2] - math.tan(least_rad) * np.maximum(rays[:, :2] @ ahead, 0)
    kept: list[Floats] = []
    for number in range(4):
        ray, after = rays[number], rays[(number + 1) % 4]
        off, off_after = above[number], above[(number + 1) % 4]
        if off > 0:
            kept.append(ray)
        if (off > 0) != (off_after > 0):
            kept.append(ray + off / (off - off_after) * (after - ray))
    if len(kept) < 3:
        return None
    found = np.array(kept)
    below = np.maximum(-found[:, 2], 1e-9)
    ground: Floats = T_map_camera[:3, 3] + found * (height / below)[:, None]
    return ground


def _reduced(bgr: Pixels, K: Floats, scale: float) -> tuple[Pixels, Floats]:
    """An image with pixels about as large as those on the ground, where they are much finer."""
    if scale > 0.5:
        return bgr, K
    small = cv2.resize(bgr, None, fx=2 * scale, fy=2 * scale, interpolation=cv2.INTER_AREA)
    ratio = np.array([small.shape[1] / bgr.shape[1], small.shape[0] / bgr.shape[0]])
    to_small = np.diag([*ratio, 1.0])
    to_small[:2, 2] = (ratio - 1) / 2
    return small, to_small @ K


def _quality(to_map: Floats, position: Floats, height: float, shape: tuple[int, int]) -> Pixels:
    """255 straight below the camera, and less at flatter angles, (H, W)."""
    x = to_map[0, 0] * np.arange(shape[1]) + to_map[0, 2] - position[0]
    y = to_map[1, 1] * np.arange(shape[0]) + to_map[1, 2] - position[1]
    slant = np.sqrt(x[None] ** 2 + y[:, None] ** 2 + height**2)
    return np.asarray(1 + 254 * height / slant, np.uint8)
