"""Places on the Earth in files for maps, as their own readers see them."""

import csv
import json
import math
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from ros_visualise.core.errors import UsageError
from ros_visualise.geometry.geodesy import LocalPlane
from ros_visualise.sinks.geography import GeoPlace, GeoTrack, check_geography, to_geography

COVARIANCE = np.array([[9.0, 4, 0], [4, 9, 0], [0, 0, 1]])
PLACE = GeoPlace(
    "post <1>\x00", "post", np.array([47.5, 8.25, 410.0]), COVARIANCE, 3, 1_700_000_000_500_000_000
)
TRACK = GeoTrack("camera", np.array([[47.5, 8.25, 500.0], [47.6, 8.3, np.nan]]))


def write(suffix, places=(PLACE,), tracks=(TRACK,)):
    return to_geography(Path(f"out{suffix}"), places, tracks).decode()


def test_an_ellipse_holds_95_of_100():
    major, minor, azimuth = PLACE.ellipse
    assert (major, minor) == (
        pytest.approx(2.4477 * math.sqrt(13), rel=1e-3),
        pytest.approx(5.473, rel=1e-3),
    )
    assert azimuth == pytest.approx(45)
    enu = LocalPlane(47.5, 8.25, 410).to_enu(PLACE.outline)[:, :2]
    inside = np.einsum("ni,ij,nj->n", enu, np.linalg.inv(COVARIANCE[:2, :2]), enu)
    np.testing.assert_allclose(inside, 5.991, rtol=1e-3)
    x, y = enu.T
    assert np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) > 0  # anticlockwise, as RFC 7946 has it


def test_geojson():
    features = json.loads(write(".geojson"))["features"]
    kinds = [one["geometry"]["type"] for one in features]
    assert kinds == ["Point", "Polygon", "LineString"]
    assert features[0]["geometry"]["coordinates"] == [8.25, 47.5, 410.0]
    assert features[0]["properties"]["covariance_m2"] == COVARIANCE.ravel().tolist()
    ring = features[1]["geometry"]["coordinates"][0]
    assert ring[0] == ring[-1]
    assert features[2]["geometry"]["coordinates"] == [[8.25, 47.5, 500.0], [8.3, 47.6]]


def test_ellipses_are_polygons_wherever_they_are():
    flat, unknown = np.diag([4.0, 0, 1]), np.array([0.0, 0.0, math.nan])
    island = np.array([-17.0, 179.99999, 5.0])
    places = [GeoPlace("a", "", island, COVARIANCE), GeoPlace("b", "", unknown, flat)]
    features = json.loads(write(".geojson", places, ()))["features"]
    east = [row[0] for row in features[1]["geometry"]["coordinates"][0]]
    assert np.ptp(east) < 0.001  # not around the Earth
    assert min(east) > 179.9
    x, y = np.array(features[3]["geometry"]["coordinates"][0]).T  # without a height
    assert np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) > 0


def test_kml_and_gpx_are_xml_with_the_names_escaped():
    kml = ET.fromstring(write(".kml"))
    space = {"k": "http://www.opengis.net/kml/2.2"}
    names = [one.text for one in kml.findall(".//k:Placemark/k:name", space)]
    assert names == ["post <1>", "post <1> 95%", "camera"]
    assert kml.find(".//k:Point/k:coordinates", space).text == "8.25,47.5,410.0"
    gpx = ET.fromstring(write(".gpx"))
    space = {"g": "http://www.topografix.com/GPX/1/1"}
    way = gpx.find("g:wpt", space)
    assert [one.tag.partition("}")[2] for one in way] == ["ele", "time", "name", "desc", "type"]
    assert way.find("g:time", space).text == "2023-11-14T22:13:20.500000Z"
    assert len(gpx.findall("g:trk", space)) == 2


def test_csv_has_a_row_for_each_place():
    (row,) = csv.DictReader(write(".csv").splitlines())
    assert (row["name"], row["class"], row["latitude"]) == ("post <1>", "post", "47.5")
    assert row["sd_east_m"] == "3"


def test_files_without_places_are_valid():
    assert json.loads(write(".geojson", (), ()))["features"] == []
    for suffix in (".kml", ".gpx"):
        ET.fromstring(write(suffix, (), ()))


def test_other_formats_are_one_line():
    with pytest.raises(UsageError, match=r"\.geojson, \.kml, \.gpx, \.csv"):
        check_geography(Path("out.shp"))
