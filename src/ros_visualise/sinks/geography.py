"""Places and tracks on the Earth in files for maps: GeoJSON, KML, GPX and CSV.

Places have an ellipse that contains them with a probability of 95 %: a polygon in GeoJSON and KML,
a closed track in GPX, its axes in CSV.

Source: RFC 7946 (GeoJSON); OGC 07-147r2 (KML 2.2); GPX 1.1 schema.
"""

from __future__ import annotations

import csv
import io
import json
import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import UsageError
from ros_visualise.data import Floats
from ros_visualise.geometry.geodesy import LocalPlane

_CHI2_95 = 5.991  # of two dimensions
_CORNERS = 36
_LEAST_M = 0.01  # semi-axis of an outline: without an area it is no valid polygon
_DIGITS = ((1, 9), (0, 9), (2, 3))  # of longitude, latitude and height
_UNPRINTABLE = dict.fromkeys([*range(9), 11, 12, *range(14, 32), 0xFFFE, 0xFFFF])
_DATED_NS = 10**18  # in 2001; stamps before it count from the start of something
_KML, _GPX = "http://www.opengis.net/kml/2.2", "http://www.topografix.com/GPX/1/1"


@dataclass(frozen=True, eq=False)
class GeoPlace:
    """A thing on the Earth.

    Attributes:
        name: its own.
        kind: its class.
        place: (3,) latitude and longitude in degrees, height in metres.
        covariance_m2: (3, 3) east, north, up.
        seen: number of images in which it was detected.
        stamp_ns: the last time.
    """

    name: str
    kind: str
    place: Floats
    covariance_m2: Floats
    seen: int = 1
    stamp_ns: int = 0

    @property
    def ellipse(self) -> tuple[float, float, float]:
        """Semi-axes in metres, the longer first, and its azimuth from north to east, degrees."""
        variances, axes = np.linalg.eigh(self.covariance_m2[:2, :2])
        minor, major = np.sqrt(_CHI2_95 * np.maximum(variances, 0))
        return float(major), float(minor), math.degrees(math.atan2(*axes[:, 1])) % 180

    @property
    def outline(self) -> Floats:
        """(37, 3) closed polygon of the ellipse, anticlockwise: latitude, longitude, height."""
        major, minor, azimuth = self.ellipse
        major, minor = max(major, _LEAST_M), max(minor, _LEAST_M)
        angles = np.linspace(0, -2 * np.pi, _CORNERS + 1)
        along, across = major * np.cos(angles), minor * np.sin(angles)
        c, s = math.cos(math.radians(azimuth)), math.sin(math.radians(azimuth))
        enu = np.column_stack([along * s + across * c, along * c - across * s, 0 * angles])
        latitude, longitude, height = self.place.tolist()
        level = height if math.isfinite(height) else 0.0
        outline = LocalPlane(latitude, longitude, level).from_enu(enu)
        outline[-1], outline[:, 2] = outline[0], height
        return outline

    @property
    def values(self) -> dict[str, Any]:
        """Its properties by name."""
        major, minor, azimuth = self.ellipse
        sigmas = np.sqrt(np.maximum(np.diag(self.covariance_m2), 0)).tolist()
        height = float(self.place[2])
        return {
            "name": self.name,
            "class": self.kind,
            "latitude": float(self.place[0]),
            "longitude": float(self.place[1]),
            "height": height if math.isfinite(height) else None,
            "seen": self.seen,
            **dict(zip(("sd_east_m", "sd_north_m", "sd_up_m"), sigmas, strict=True)),
            "ellipse_major_m": major,
            "ellipse_minor_m": minor,
            "ellipse_azimuth_deg": azimuth,
        }


@dataclass(frozen=True, eq=False)
class GeoTrack:
    """A way on the Earth: places (N, 3), N > 1, with their stamps (N,)."""

    name: str
    places: Floats
    stamps_ns: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))


def check_geography(path: Path) -> None:
    """Reject a file whose format is unknown; raises UsageError."""
    if path.suffix.lower() not in _WRITERS:
        raise UsageError(f"{path}: give a name that ends in {', '.join(_WRITERS)}")


def to_geography(path: Path, places: Sequence[GeoPlace], tracks: Sequence[GeoTrack]) -> bytes:
    """A file with these places and tracks, in the format of its name."""
    return _WRITERS[path.suffix.lower()](places, tracks)


def to_geojson(places: Iterable[GeoPlace], tracks: Iterable[GeoTrack] = ()) -> str:
    """A collection of features: points with their properties, their ellipses, and lines."""
    features: list[dict[str, Any]] = []
    for one in places:
        values = one.values | {"covariance_m2": one.covariance_m2.ravel().tolist()}
        features.append(_feature("Point", _lon_lat(one.place[None])[0], values))
        named = {"name": f"{one.name} 95%", "class": one.kind, "of": one.name}
        features.append(_feature("Polygon", [_lon_lat(_near(one.outline, one.place[1]))], named))
    for track in tracks:
        along = _lon_lat(_near(track.places, track.places[0, 1]))
        features.append(_feature("LineString", along, {"name": track.name}))
    return json.dumps({"type": "FeatureCollection", "features": features}, allow_nan=False)


def _feature(kind: str, coordinates: Any, values: Mapping[str, Any]) -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "geometry": geometry, "properties": dict(values)}


def _near(places: Floats, longitude: float) -> Floats:
    """Places with longitudes within 180 degrees of one, so that no line goes around the Earth."""
    longitudes = longitude + (places[:, 1] - longitude + 180) % 360 - 180
    return np.column_stack([places[:, 0], longitudes, places[:, 2]])


def _lon_lat(places: Floats) -> list[list[float]]:
    """Longitude, latitude and height, to a millimetre and better."""
    rows = zip(*(places[:, n].round(digits).tolist() for n, digits in _DIGITS), strict=True)
    return [list(row if math.isfinite(row[2]) else row[:2]) for row in rows]


def _geojson(places: Sequence[GeoPlace], tracks: Sequence[GeoTrack]) -> bytes:
    return to_geojson(places, tracks).encode()


def _kml(places: Sequence[GeoPlace], tracks: Sequence[GeoTrack]) -> bytes:
    root = ET.Element("kml", xmlns=_KML)
    document = ET.SubElement(root, "Document")
    style = ET.SubElement(document, "Style", id="ellipse")
    _text(ET.SubElement(style, "LineStyle"), color="ff00a5ff", width="2")
    _text(ET.SubElement(style, "PolyStyle"), color="4000a5ff")
    for one in places:
        mark = ET.SubElement(document, "Placemark")
        _text(mark, name=one.name)
        data = ET.SubElement(mark, "ExtendedData")
        for name, value in one.values.items():
            _text(ET.SubElement(data, "Data", name=name), value=_word(value))
        _text(ET.SubElement(mark, "Point"), coordinates=_coordinates(one.place[None]))
        around = ET.SubElement(document, "Placemark")
        _text(around, name=f"{one.name} 95%", styleUrl="#ellipse")
        ring = ET.SubElement(ET.SubElement(around, "Polygon"), "outerBoundaryIs")
        _text(ET.SubElement(ring, "LinearRing"), coordinates=_coordinates(one.outline))
    for track in tracks:
        mark = ET.SubElement(document, "Placemark")
        _text(mark, name=track.name)
        _text(
            ET.SubElement(mark, "LineString"),
            tessellate="1",
            coordinates=_coordinates(track.places),
        )
    return _document(root)


def _gpx(places: Sequence[GeoPlace], tracks: Sequence[GeoTrack]) -> bytes:
    root = ET.Element("gpx", xmlns=_GPX, version="1.1", creator="ros_visualise")
    for one in places:
        major, minor, azimuth = one.ellipse
        said = f"seen {one.seen} times; 95% ellipse {major:.2f} m x {minor:.2f} m at {azimuth:.0f}°"
        _text(_point(root, "wpt", one.place, one.stamp_ns), name=one.name, desc=said, type=one.kind)
    outlines = [GeoTrack(f"{one.name} 95%", one.outline) for one in places]
    for track in (*outlines, *tracks):
        mark = ET.SubElement(root, "trk")
        _text(mark, name=track.name)
        segment = ET.SubElement(mark, "trkseg")
        stamps = track.stamps_ns.tolist() or [0] * len(track.places)
        for place, stamp_ns in zip(track.places, stamps, strict=True):
            _point(segment, "trkpt", place, stamp_ns)
    return _document(root)


def _point(parent: ET.Element, kind: str, place: Floats, stamp_ns: int) -> ET.Element:
    latitude, longitude, height = place.tolist()
    point = ET.SubElement(parent, kind, lat=f"{latitude:.9f}", lon=f"{longitude:.9f}")
    if math.isfinite(height):
        _text(point, ele=f"{height:.3f}")
    if stamp_ns >= _DATED_NS:
        at = datetime.fromtimestamp(stamp_ns / 1e9, timezone.utc)
        _text(point, time=at.strftime("%Y-%m-%dT%H:%M:%S.%fZ"))
    return point


def _csv(places: Sequence[GeoPlace], tracks: Sequence[GeoTrack]) -> bytes:
    """A row for each place; tracks have no rows."""
    text = io.StringIO()
    table = csv.writer(text)
    table.writerow(GeoPlace("", "", np.zeros(3), np.eye(3)).values)
    table.writerows(map(_word, one.values.values()) for one in places)
    return text.getvalue().encode()


def _word(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.9f}".rstrip("0").rstrip(".")
    return str(value).translate(_UNPRINTABLE)


def _coordinates(places: Floats) -> str:
    return " ".join(",".join(map(str, row)) for row in _lon_lat(places))


def _text(parent: ET.Element, **texts: str) -> None:
    for name, text in texts.items():
        ET.SubElement(parent, name).text = text.translate(_UNPRINTABLE)


def _document(root: ET.Element) -> bytes:
    ET.indent(root)
    found: bytes = ET.tostring(root, "utf-8", xml_declaration=True)
    return found + b"\n"


_WRITERS: dict[str, Callable[[Sequence[GeoPlace], Sequence[GeoTrack]], bytes]] = {
    ".geojson": _geojson,
    ".kml": _kml,
    ".gpx": _gpx,
    ".csv": _csv,
}
