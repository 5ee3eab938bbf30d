"""Tracks in GPX files and tables: times, units, angles, and what is wrong in them."""

from contextlib import closing

import numpy as np
import pytest

from ros_visualise.core.errors import OpenError
from ros_visualise.geometry.rotations import to_matrix
from ros_visualise.messages.recorded import content
from ros_visualise.sources import open_source

GPX = """<?xml version="1.0"?>
<gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>
<trkpt lat="47.5" lon="8.25"><ele>400</ele><time>2024-05-01T10:00:00Z</time></trkpt>
<trkpt lat="47.6" lon="8.25"><ele>410</ele><time>2024-05-01T10:00:01.500Z</time></trkpt>
</trkseg></trk></gpx>
"""
AIRDATA = """time(millisecond),datetime(utc),latitude,longitude,height_above_takeoff(feet),\
altitude_above_seaLevel(feet),gimbal_heading(degrees),gimbal_pitch(degrees)
0,2024-05-01 10:00:00,47.5,8.25,100,1400,90,-90
100,2024-05-01 10:00:00,47.5,8.2501,100,1400,90,-90
200,2024-05-01 10:00:00,0,0,100,1400,90,-90
"""


def read(path, text):
    path.write_text(text)
    with closing(open_source(path)) as recording:
        found = {}
        for topic, stamp_ns, message in recording.read():
            found.setdefault(topic, []).append((stamp_ns, content(message)))
        return found, recording.loss


def test_gpx(tmp_path):
    found, loss = read(tmp_path / "track.gpx", GPX)
    assert found.keys() == {"/fix"}
    (a, first), (b, second) = found["/fix"]
    assert (a, b) == (1714557600 * 10**9, 1714557601_500_000_000)
    assert (first.latitude, second.altitude) == (47.5, 410)
    assert not loss
    cut, loss = read(tmp_path / "cut.gpx", GPX[: GPX.index("</trkseg>") - 20])
    assert (len(cut["/fix"]), bool(loss)) == (1, True)


def test_a_table_with_angles_and_feet(tmp_path):
    found, _ = read(tmp_path / "airdata.csv", AIRDATA)
    assert found.keys() == {"/fix", "/tf", "/map_origin"}
    assert [stamp for stamp, _ in found["/fix"]] == [0, 100_000_000]
    ((_, origin),) = found["/map_origin"]
    assert origin.altitude == pytest.approx(1300 * 0.3048)
    (transform,) = found["/tf"][0][1].transforms
    np.testing.assert_allclose(transform.translation_xyz, [0, 0, 30.48], atol=1e-6)
    R = to_matrix(transform.quat_xyzw)
    np.testing.assert_allclose(R @ [0, -1, 0], [1, 0, 0], atol=1e-9)


def test_a_table_with_semicolons_and_decimal_commas(tmp_path):
    text = "time;latitude;longitude;altitude\r0;47,5;8,25;400,5\r1;47,6;8,25;401\r"
    found, loss = read(tmp_path / "a.csv", text)
    fixes = [message for _, message in found["/fix"]]
    assert [(one.latitude, one.altitude) for one in fixes] == [(47.5, 400.5), (47.6, 401)]
    assert not loss


@pytest.mark.parametrize(
    ("times", "expected"),
    [
        (("1714557600.5", "1714557601"), 1714557600.5),
        (("1714557600500", "1714557601000"), 1714557600.5),
        (("2024-05-01T10:00:00.5Z", "2024-05-01T10:00:01+00:00"), 1714557600.5),
        (("12.5", "13"), 12.5),
        (("soon", "later"), 0),
    ],
)
def test_times_of_any_kind(times, expected, tmp_path):
    rows = "\n".join(f"{time};47.5;8.25;400" for time in times)
    found, _ = read(tmp_path / "t.csv", f"Time;Lat;Lon;Alt\n{rows}\n")
    assert found["/fix"][0][0] / 1e9 == pytest.approx(expected)


def test_damage_is_said(tmp_path):
    found, loss = read(tmp_path / "a.csv", "lat,lon\n47.5,8.25\n47.6\nx,y\n")
    assert (len(found["/fix"]), loss.messages) == (1, 1)
    for name, text in {
        "none.csv": "lat,lon\n0,0\n",
        "empty.csv": "lat,lon\n",
        "other.csv": "a,b\n1,2\n",
        "none.gpx": "<gpx></gpx>",
        "bomb.gpx": '<gpx><!DOCTYPE x [<!ENTITY a "b">]></gpx>',
    }.items():
        (tmp_path / name).write_text(text)
        with pytest.raises(OpenError, match=name):
            open_source(tmp_path / name)
