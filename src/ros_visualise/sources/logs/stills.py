"""Positions, attitudes and lenses in the EXIF and XMP data of pictures.

Source: CIPA DC-008, Exif 2.32; XMP of DJI (``drone-dji``: angles of the gimbal, pitch -90 straight
down), of Parrot (``drone-parrot``: the same of the camera) and of Pix4D (``Camera``: pitch 0
straight down).
"""

from __future__ import annotations

import logging
import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image

from ros_visualise.core import supervision
from ros_visualise.core.regular_files import open_file
from ros_visualise.data import CameraInfo
from ros_visualise.sources.camera_poses import (
    CameraPoses,
    angle_quats,
    camera_series,
    lens_series,
    optical_quats,
)
from ros_visualise.sources.series import Series
from ros_visualise.vision.lens_table import lens_of_focal, lens_of_model

log = logging.getLogger(__name__)

NS_PER_PICTURE = 1_000_000_000
_MODEL, _ORIENTATION, _EXIF, _GPS = 0x0110, 0x0112, 0x8769, 0x8825
_FOCAL_35MM, _WIDTH, _HEIGHT = 0xA405, 0xA002, 0xA003
_LAT_REF, _LAT, _LON_REF, _LON, _ALT_REF, _ALT, _ERROR = 1, 2, 3, 4, 5, 6, 31
_VALUE = re.compile(
    r"""([\w-]+:\w+)(?:\s*=\s*["']|>)\s*([-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?:/\d+)?)\s*["'<]"""
)
_ANGLES = (
    ("drone-dji:Gimbal{}Degree", 0.0),
    ("drone-parrot:Camera{}Degree", 0.0),
    ("Camera:{}", -90.0),
)
"""Names of yaw, pitch and roll, and the pitch upwards at which theirs is 0."""
_ERRORS = (
    ("drone-dji:RtkStdLon", "drone-dji:RtkStdLat", "drone-dji:RtkStdHgt"),
    ("Camera:GPSXYAccuracy", "Camera:GPSXYAccuracy", "Camera:GPSZAccuracy"),
)
_MOST_XMP = 1 << 20
_UNKNOWN = (math.nan, math.nan, math.nan)
_Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Still:
    """Camera data of a picture; unknown numbers are NaN.

    Attributes:
        place: latitude and longitude, degrees, and altitude, metres.
        height_m: above the point of take-off.
        angles_deg: yaw from north to east, pitch upwards, roll to the right.
        sigmas_m: standard deviations of the place: east, north, up.
        lens: by its focal length, or its model; None: unknown.
    """

    place: _Triple = _UNKNOWN
    height_m: float = math.nan
    angles_deg: _Triple = _UNKNOWN
    sigmas_m: _Triple = _UNKNOWN
    lens: CameraInfo | None = None


def still_series(files: Sequence[Path]) -> list[Series]:
    """The topics of pictures that are shown one each second; none without data in them."""
    stills = [read_still(file) for file in files]
    if not stills:
        return []
    stamps_ns = [number * NS_PER_PICTURE for number in range(len(files))]
    ground_m = next((g for one in stills if math.isfinite(g := one.place[2] - one.height_m)), None)
    places = np.array([one.place for one in stills])
    if ground_m is not None:  # heights above take-off are better than altitudes
        heights = np.array([one.height_m for one in stills])
        places[:, 2] = np.where(np.isfinite(heights), ground_m + heights, places[:, 2])
    poses = CameraPoses(
        np.array(stamps_ns, np.int64),
        places,
        optical_quats(angle_quats([one.angles_deg for one in stills])),
        math.nan if ground_m is None else ground_m,
        sigmas_m=np.array([one.sigmas_m for one in stills]),
    )
    lenses = [
        (stamp_ns, one.lens)
        for stamp_ns, one in zip(stamps_ns, stills, strict=True)
        if one.lens is not None
    ]
    found = camera_series(poses, is_track=False)
    return [*found, *lens_series(lenses)] if found else []


def read_still(file: Path) -> Still:
    """The data of a picture; damaged and missing ones are unknown."""
    try:
        with open_file(file) as opened, PIL.Image.open(opened) as picture:
            exif = picture.getexif()
            size, xmp = picture.size, _xmp(picture)
            own, gps = exif.get_ifd(_EXIF), exif.get_ifd(_GPS)
    except OSError:  # reported when it is shown
        return Still()
    except supervision.ERRORS as error:
        log.warning("%s: ignoring damaged metadata: %s", file, error or type(error).__name__)
        return Still()
    is_turned = exif.get(_ORIENTATION, 1) not in (0, 1) or _is_on_its_side(own, size)
    if is_turned:
        log.warning("%s: rotated after it was taken; ignoring its camera angles", file)
    model = str(exif.get(_MODEL, ""))
    focal_mm = _number(own.get(_FOCAL_35MM))
    lens = lens_of_focal(focal_mm, size) if focal_mm > 0 else lens_of_model(model, size)
    return Still(
        (*_position(gps, xmp), _altitude(gps, xmp)),
        xmp.get("drone-dji:RelativeAltitude", math.nan),
        _UNKNOWN if is_turned else _angles(xmp),
        _errors(gps, xmp),
        None if is_turned else lens,
    )


def _is_on_its_side(own: Mapping[int, Any], size: tuple[int, int]) -> bool:
    """True if a picture is upright and was wide when it was taken, or the other way round."""
    width, height = _number(own.get(_WIDTH)), _number(own.get(_HEIGHT))
    return (width - height) * (size[0] - size[1]) < 0


def _xmp(picture: Any) -> dict[str, float]:
    """The numbers in the XMP data of a picture, by name."""
    data = picture.info.get("xmp") or picture.info.get("XML:com.adobe.xmp") or b""
    text = data if isinstance(data, str) else bytes(data[:_MOST_XMP]).decode("utf-8", "replace")
    found: dict[str, float] = {}
    for name, value in _VALUE.findall(text[:_MOST_XMP]):
        upper, _, lower = value.partition("/")
        with suppress(ZeroDivisionError):
            found.setdefault(name, float(upper) / float(lower or 1))
    return {name: value for name, value in found.items() if math.isfinite(value)}


def _position(gps: Mapping[int, Any], xmp: Mapping[str, float]) -> tuple[float, float]:
    latitude = _degrees(gps.get(_LAT), gps.get(_LAT_REF), "NS")
    longitude = _degrees(gps.get(_LON), gps.get(_LON_REF), "EW")
    own = [xmp.get(f"drone-dji:Gps{name}") for name in ("Latitude", "Longitude", "Longtitude")]
    for found in ((own[0], own[1]), (own[0], own[2]), (latitude, longitude)):
        place = np.array(found, np.float64)  # NaN for None
        if np.isfinite(place).all() and place.any():
            return float(place[0]), float(place[1])
    return math.nan, math.nan


def _altitude(gps: Mapping[int, Any], xmp: Mapping[str, float]) -> float:
    if "drone-dji:AbsoluteAltitude" in xmp:
        return xmp["drone-dji:AbsoluteAltitude"]
    below = gps.get(_ALT_REF) in (1, b"\x01")
    return _number(gps.get(_ALT)) * (-1 if below else 1)


def _angles(xmp: Mapping[str, float]) -> _Triple:
    for name, level in _ANGLES:
        yaw, pitch, roll = (xmp.get(name.format(one), math.nan) for one in ("Yaw", "Pitch", "Roll"))
        if math.isfinite(yaw + pitch):
            return yaw, pitch + level, roll if math.isfinite(roll) else 0.0
    return _UNKNOWN


def _errors(gps: Mapping[int, Any], xmp: Mapping[str, float]) -> _Triple:
    for east, north, up in _ERRORS:
        found = xmp.get(east, 0.0), xmp.get(north, 0.0), xmp.get(up, 0.0)
        if min(found) > 0:
            return found
    horizontal = _number(gps.get(_ERROR))
    return (horizontal, horizontal, 2 * horizontal) if horizontal > 0 else _UNKNOWN


def _degrees(value: Any, reference: Any, letters: str) -> float:
    """Degrees of three rationals; unknown without a letter for the hemisphere."""
    letter = str(reference).strip("\0 ").upper()[:1]
    try:
        degrees, minutes, seconds = (*(float(one) for one in value), 0.0, 0.0)[:3]
    except (TypeError, ValueError, ZeroDivisionError):
        return math.nan
    if not letter or letter not in letters:
        return math.nan
    return (degrees + minutes / 60 + seconds / 3600) * (1 if letter == letters[0] else -1)


def _number(value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError, ZeroDivisionError):
        return math.nan
