"""The node that lays images on the ground."""

from __future__ import annotations

import base64
import json
import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import param
from ros_visualise.data import CameraInfo, Floats, Image, NavSatFix, Pixels, Text
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.geometry.geodesy import LocalPlane
from ros_visualise.landmarks.georeferencing.mosaic import Mosaic, MosaicPicture, footprint
from ros_visualise.landmarks.georeferencing.origin import (
    BODY,
    MAP,
    MapOrigin,
    OriginFinder,
    map_frame,
)
from ros_visualise.landmarks.once_log import OnceLog
from ros_visualise.nodes import action, node
from ros_visualise.sinks.files import save_again
from ros_visualise.vision import color
from ros_visualise.vision.lens_table import find_lens
from ros_visualise.vision.rectification import Interpolation, model_of, rectify
from ros_visualise.vision.reshape import resized

log = logging.getLogger(__name__)

_SENT_PX, _SAVED_PX = 1 << 20, 64 << 20
_SENT_NS = 2_000_000_000
_SIGMAS = np.array([3.0, 3.0, 6.0])  # metres, of fixes without a covariance


@dataclass(frozen=True)
class MosaicParams:
    """Parameters of `Mosaicking`."""

    save_to: str = param(
        "", "GeoTIFF to write at the end, such as mosaic.tif; empty: none", file=bool
    )
    resolution: float = param(
        0.0,
        "side of a pixel on the ground, metres; 0: as fine as the first image",
        min=0,
        max=100,
        slider=(0, 2),
        restart=True,
    )
    tiles: int = param(
        400,
        "largest number of tiles of 256 x 256 pixels (256 KiB); beyond it, pixels become twice"
        " as large",
        min=16,
        max=16_384,
        slider=(100, 2000),
        restart=True,
    )
    spacing: float = param(
        0.1,
        "minimum movement on the ground before the next image is added, as a fraction of the"
        " image's width; 0 adds every image",
        min=0,
        max=1,
    )
    min_angle: float = param(
        20.0,
        "minimum angle below the horizon, degrees; ground seen at a shallower angle is omitted",
        min=1,
        max=89,
    )
    fixed_frame: str = param(
        MAP,
        "frame with x east, y north, z up; if no frame named map exists, odom is used instead",
    )
    ground_height: float = param(
        0.0,
        "height of the ground in the fixed frame, metres",
        min=-1e4,
        max=1e4,
        slider=(-50, 50),
    )
    lens: str = param(
        "",
        "lens of an uncalibrated camera: its horizontal field of view, degrees, or its name, such"
        " as mini 2; empty: as the source says",
    )

    def __post_init__(self) -> None:
        if self.save_to and Path(self.save_to).suffix.lower() not in (".tif", ".tiff"):
            raise ParameterError(f"save_to={self.save_to}: give a name that ends in .tif")


@node(
    "mosaic",
    params=MosaicParams,
    inputs={"image": Image, "fix": NavSatFix, "map_origin": NavSatFix, "lens": CameraInfo},
    outputs={"footprint": Text, "picture": Text},
    topics={"footprint": "/mosaic/footprint_geojson", "picture": "/mosaic/picture_geojson"},
    on_demand=("picture",),
    frames=True,
    calibrated=True,
    splittable=False,
)
class Mosaicking:
    """Projects images onto level ground to make a map of everything seen; saves it as GeoTIFF.

    ``footprint`` is the part of the ground that an image shows, ``picture`` the mosaic, both in
    GeoJSON. The place on the Earth is that of the source's origin, else estimated from fixes.
    """

    def __init__(self, params: MosaicParams) -> None:
        self._remarks = OnceLog("mosaic")
        self._params = params
        self._mosaic = Mosaic(params.resolution, params.tiles)
        self._lens: CameraInfo | None = None
        self._laid = 0
        self._camera = ""
        self._finder = OriginFinder()
        self._last: Floats | None = None  # footprint of the image that was laid last
        self._sent_ns = -_SENT_NS

    def reset(self) -> None:
        """Forget fixes: time jumped. The mosaic stays."""
        self._finder = OriginFinder()
        self._last, self._sent_ns = None, -_SENT_NS

    def step(
        self,
        params: MosaicParams,
        image: Image | None = None,
        fix: NavSatFix | None = None,
        map_origin: NavSatFix | None = None,
        lens: CameraInfo | None = None,
        *,
        frames: FrameTree,
    ) -> dict[str, Any] | None:
        """Lay an image on the ground."""
        self._params = params
        self._lens = lens or self._lens
        if map_origin is not None:
            self._finder.given = MapOrigin.of(map_origin)
        if fix is not None:
            self._take_fix(fix, frames)
        return None if image is None else self._lay(image, frames)

    def finish(self) -> None:
        """Write the file, if any, at the end."""
        if self._params.save_to:
            self.save_mosaic(self._params)

    def report(self) -> dict[str, Any]:
        """Number of images that were laid, and the side of a pixel, metres."""
        return {"laid": self._laid, "resolution": self._mosaic.resolution_m}

    @action("write the mosaic to the file that save_to names")
    def save_mosaic(self, params: MosaicParams) -> None:
        """Write the mosaic as GeoTIFF; raises ParameterError without a name."""
        path, origin = Path(params.save_to), self._finder.origin
        if not params.save_to:
            raise ParameterError("set save_to to a file name, such as mosaic.tif")
        picture = self._mosaic.picture(_SAVED_PX)
        if picture is None or origin is None:
            log.warning("mosaic: no images on the ground yet; nothing saved")
            return
        save_again(path, picture.geotiff(origin.plane))
        height, width = picture.pixels.shape[:2]
        log.info("mosaic of %d x %d pixels saved to %s", width, height, path.absolute())

    def _lay(self, image: Image, frames: FrameTree) -> dict[str, Any] | None:
        origin, info = self._finder.origin, self._calibration(image)
        self._camera = image.header.frame_id
        if origin is None or info is None:
            missing = "position: give fixes, as on /fix" if info else "lens: calibrate, or set lens"
            self._remarks.say(f"no {missing}")
            return None
        params, header = self._params, image.header
        fixed = map_frame(self._params.fixed_frame, frames)
        T = frames.lookup(fixed, header.frame_id, header.stamp_ns)
        size = image.width, image.height
        ground = footprint(info.K, size, T, params.ground_height, math.radians(params.min_angle))
        if ground is None:
            return None
        if self._is_far(ground):
            self._last = ground
            self._laid += 1
            self._mosaic.add(_without_distortion(image, info), info.K, T, ground)
        answer = {"footprint": Text(_geojson("footprint", ground, origin.plane), header)}
        if not 0 <= header.stamp_ns - self._sent_ns < _SENT_NS and self._mosaic:
            self._sent_ns = header.stamp_ns
            picture = self._mosaic.picture(_SENT_PX)
            assert picture is not None
            answer["picture"] = Text(_as_geojson(picture, origin.plane), header)
        return answer

    def _is_far(self, ground: Floats) -> bool:
        """True if an image shows other ground than the last one that was laid."""
        if self._last is None or len(self._last) != len(ground):
            return True
        width = float(np.linalg.norm(np.ptp(ground[:, :2], axis=0)))
        moved = np.linalg.norm(ground - self._last, axis=1).max()
        return bool(moved >= self._params.spacing * width)

    def _calibration(self, image: Image) -> CameraInfo | None:
        """Calibration of the image, without an offset of rectification."""
        size = image.width, image.height
        if self._params.lens:
            return find_lens(self._params.lens, size)
        info = image.camera_info
        info = info if info is not None and info.K[0, 0] > 0 else self._lens
        if info is not None and (info.width, info.height) != size:
            info = resized(info, (info.width, info.height), size)
        return info

    def _take_fix(self, fix: NavSatFix, frames: FrameTree) -> None:
        """Estimate the origin by a fix."""
        fixed = map_frame(self._params.fixed_frame, frames)
        if not self._finder.take(fix, fixed, (BODY, self._camera), frames, _SIGMAS):
            self._remarks.say(f"no frame {fix.header.frame_id} or {BODY}: fixes are not used")


def _without_distortion(image: Image, info: CameraInfo) -> Pixels:
    """The image in colour, as a lens without distortion would show it by the same K."""
    bgr = color.bgr_of(image)
    model = model_of(info, -1)
    plain = np.column_stack((info.K, np.zeros(3)))
    model = model._replace(R=np.eye(3), P=plain)
    return bgr if model.is_ideal else rectify(bgr, model, Interpolation.LINEAR)


def _geojson(name: str, ground: Floats, plane: LocalPlane, **more: Any) -> str:
    """A polygon of points (N, 3) in the map, with its name."""
    places = plane.from_enu(ground)
    ring = [[round(float(lon), 8), round(float(lat), 8)] for lat, lon, _ in places]
    return _collection(name, [*ring, ring[0]], more)


def _as_geojson(picture: MosaicPicture, plane: LocalPlane) -> str:
    """The edges of a mosaic, with the picture as a property ``image``."""
    west, south, east, north = picture.bounds(plane)
    ring = [[west, south], [east, south], [east, north], [west, north], [west, south]]
    data = cv2.imencode(".webp", picture.pixels, [cv2.IMWRITE_WEBP_QUALITY, 70])[1]
    image = f"data:image/webp;base64,{base64.b64encode(data.tobytes()).decode()}"
    return _collection("mosaic", ring, {"image": image})


def _collection(name: str, ring: Sequence[Sequence[float]], more: dict[str, Any]) -> str:
    geometry = {"type": "Polygon", "coordinates": [ring]}
    feature = {"type": "Feature", "geometry": geometry, "properties": {"name": name, **more}}
    return json.dumps({"type": "FeatureCollection", "features": [feature]})
