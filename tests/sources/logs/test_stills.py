"""What pictures say of their camera: EXIF and XMP, real and drawn, damaged and missing."""

import numpy as np
import PIL.Image
import pytest
from PIL.ExifTags import GPS
from PIL.TiffImagePlugin import IFDRational

from ros_visualise.geometry import rotations
from ros_visualise.sources.logs.stills import read_still, still_series

XMP = """<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:Description
 drone-dji:RelativeAltitude="+30.50" drone-dji:AbsoluteAltitude="+130.50"
 drone-dji:GimbalRollDegree="+0.00" drone-dji:GimbalYawDegree="{yaw}"
 drone-dji:GimbalPitchDegree="-90.00"/></x:xmpmeta>"""
PIX4D = """<Camera:Yaw>90/1</Camera:Yaw><Camera:Pitch>30</Camera:Pitch><Camera:Roll>0</Camera:Roll>
<Camera:GPSXYAccuracy>0.5</Camera:GPSXYAccuracy><Camera:GPSZAccuracy>1.5</Camera:GPSZAccuracy>"""


def write(path, xmp="", gps=True, orientation=1, model="FC7303", taken=None):
    exif = PIL.Image.Exif()
    if taken:
        exif.get_ifd(0x8769).update(zip((0xA002, 0xA003), taken, strict=True))
    exif[0x0112], exif[0x0110] = orientation, model
    if gps:
        place = exif.get_ifd(0x8825)
        place[GPS.GPSLatitudeRef], place[GPS.GPSLatitude] = "S", (33.0, 30.0, 36.0)
        place[GPS.GPSLongitudeRef], place[GPS.GPSLongitude] = "W", (70.0, 15.0, 0.0)
        place[GPS.GPSAltitudeRef], place[GPS.GPSAltitude] = b"\x00", 120.0
    PIL.Image.new("RGB", (400, 300)).save(path, exif=exif, xmp=xmp.encode())
    return path


def test_a_real_still(recordings):
    still = read_still(recordings / "video" / "DJI_0020.JPG")
    assert still.place == pytest.approx((46.842778, -91.994299, 198.61), abs=1e-6)
    assert (still.height_m, still.angles_deg) == (40.1, (44.2, -89.9, 0.0))
    # Pix4D has 3.61 mm for a sensor of 6.317 mm in its table of cameras
    assert still.lens.K[0, 0] == pytest.approx(3.61 / 6.317 * 4000, rel=0.02)


def test_a_folder_gives_poses_above_the_point_of_take_off(tmp_path):
    files = [write(tmp_path / f"{n}.jpg", XMP.format(yaw=yaw)) for n, yaw in enumerate((0, 90))]
    series = {one.topic: one for one in still_series(files)}
    assert series.keys() == {"map_origin", "tf", "fix", "lens"}
    origin, fix = series["map_origin"].make(0), series["fix"].make(1)
    assert (origin.latitude, origin.altitude) == (pytest.approx(-33.51), 100.0)
    assert (fix.longitude, fix.altitude, fix.header.stamp_ns) == (-70.25, 130.5, 10**9)
    for number, north in enumerate(([0, 1, 0], [1, 0, 0])):
        (transform,) = series["tf"].make(number).transforms
        assert transform.translation_xyz[2] == pytest.approx(30.5)
        R = rotations.to_matrix(transform.quat_xyzw)
        np.testing.assert_allclose(R @ [0, 0, 1], [0, 0, -1], atol=1e-9)
        np.testing.assert_allclose(R @ [0, -1, 0], north, atol=1e-9)  # the image's upper edge


def test_the_angles_of_other_makers(tmp_path):
    still = read_still(write(tmp_path / "a.jpg", PIX4D))
    assert still.angles_deg == (90, -60, 0)
    assert still.sigmas_m == (0.5, 0.5, 1.5)


def test_what_is_not_known_is_not_made_up(tmp_path, caplog):
    (tmp_path / "bad.jpg").write_bytes(b"\xff\xd8\xff\xe1\x00\x10Exif\0\0II*\0")
    (tmp_path / "empty.jpg").write_bytes(b"")
    plain = write(tmp_path / "plain.jpg", gps=False)
    assert still_series([]) == []
    assert still_series([plain, tmp_path / "bad.jpg", tmp_path / "empty.jpg"]) == []
    assert [one.topic for one in still_series([write(tmp_path / "gps.jpg")])] == ["fix", "lens"]
    turned = write(tmp_path / "turned.jpg", XMP.format(yaw=0), orientation=6)
    assert [one.topic for one in still_series([turned])] == ["fix"]
    for taken, topics in (
        ((300, 400), ["fix"]),
        ((4000, 3000), ["map_origin", "tf", "fix", "lens"]),
    ):
        sides = write(tmp_path / "sides.jpg", XMP.format(yaw=0), taken=taken)
        assert [one.topic for one in still_series([sides])] == topics
    assert caplog.text.count("rotated after it was taken") == 2
    absurd = write(tmp_path / "absurd.jpg", XMP.format(yaw="1e999/0"))
    assert np.isnan(read_still(absurd).angles_deg).all()


def test_odd_positions(tmp_path):
    def place(**changes):
        exif = PIL.Image.Exif()
        gps = {"LatitudeRef": "S", "Latitude": (33, 30.6), "LongitudeRef": "west\0"}
        gps |= {"Longitude": (70, 15, 0), "Altitude": 5.0} | changes
        exif.get_ifd(0x8825).update({GPS[f"GPS{name}"]: value for name, value in gps.items()})
        PIL.Image.new("RGB", (40, 30)).save(tmp_path / "a.jpg", exif=exif)
        return read_still(tmp_path / "a.jpg").place[:2]

    assert place() == pytest.approx((-33.51, -70.25))
    undefined = (IFDRational(33, 1), IFDRational(30, 1), IFDRational(0, 0))
    for changes in ({"Latitude": undefined}, {"LatitudeRef": ""}, {"LongitudeRef": "X"}):
        assert np.isnan(place(**changes)).all()
    absurd = write(tmp_path / "b.jpg", XMP.format(yaw=0).replace("+130.50", "9" * 400))
    assert read_still(absurd).place[2] == 120
