"""MISB's metadata in films: values of the standard, damage, and poses from a muxed film."""

import struct
from contextlib import closing
from fractions import Fraction

import av
import numpy as np
import pytest

from ros_visualise.geometry import rotations, se3
from ros_visualise.geometry.geodesy import LocalPlane
from ros_visualise.landmarks.georeferencing.ground import LevelSurface
from ros_visualise.nodes.streamer import StreamerParams, film
from ros_visualise.sources import open_source
from ros_visualise.sources.logs.klv import KEY, KlvStream, read_set
from ros_visualise.sources.playback import Playback
from ros_visualise.sources.telemetry import telemetry_of

EXAMPLES = {  # tag, value in hexadecimal -> of the standard's own examples
    (5, "71c2"): ("platform_heading", 159.974365),
    (6, "fd3d"): ("platform_pitch", -0.431531724),
    (7, "08b8"): ("platform_roll", 3.405865658),
    (13, "5595b66d"): ("sensor_latitude", 60.17682297),
    (14, "5b5360c4"): ("sensor_longitude", 128.426759042),
    (15, "c221"): ("sensor_altitude", 14190.7195),
    (16, "cd9c"): ("sensor_horizontal_fov", 144.571298),
    (18, "724a0a20"): ("sensor_relative_azimuth", 160.719211474),
    (19, "87f84b86"): ("sensor_relative_elevation", -168.792324834),
    (21, "03830926"): ("slant_range", 68590.983298744),
    (23, "f101a229"): ("frame_center_latitude", -10.542388633),
    (25, "34f3"): ("frame_center_elevation", 3216.037232013),
    (65, "06"): ("version", 6),
    (6, "8000"): ("platform_pitch", np.nan),
    (90, "ff62e2f2"): ("platform_pitch_full", -0.43152510208614),
    (3, "4d697373696f6e203132"): ("mission_id", "Mission 12"),
    (10, "5072656461746f72"): ("platform_designation", "Predator"),
}

SAMPLE = bytes.fromhex(  # of ST 0902.5, which prints aa43 as its checksum
    "060e2b34020b01010e0103010100000081d2020800046050584e0180030a4d697373696f6e203132050271c20602"
    "fd3d070208b80a085072656461746f720b07454f204e6f73650c0e47656f64657469632057475338340d045595b6"
    "6d0e045b5360c40f02c2211002cd9c1102d9171204724a0a20130487f84b8614047dc55ece150403830926160212"
    "811704f101a229180414bc082b190234f3301c01010102010703052f2f5553410c01070d06005500530041160200"
    "0a4101065e220170f592f02373364af8aa9162c00f2eb2da16b74341000841a0be365b5ab96a36450102"
)


def pack(items, oid=False):
    """A set with its checksum."""
    body = b""
    for tag, value in items.items():
        key = bytes([0x80 | tag >> 7, tag & 127]) if tag > 127 or oid else bytes([tag])
        body += (
            key
            + (bytes([len(value)]) if len(value) < 128 else b"\x81" + bytes([len(value)]))
            + value
        )
    size = len(body) + 4
    head = KEY + (bytes([size]) if size < 128 else b"\x82" + struct.pack(">H", size))
    whole = head + body + b"\x01\x02"
    total = sum(byte << 8 * (1 - n % 2) for n, byte in enumerate(whole)) & 0xFFFF
    return whole + struct.pack(">H", total)


def linear(value, low, high, size):
    return round((value - low) / (high - low) * (256**size - 1)).to_bytes(size, "big")


def symmetric(value, most, size):
    return round(value / most * (256**size // 2 - 1)).to_bytes(size, "big", signed=True)


def aircraft(heading=90.0, azimuth=0.0, elevation=-45.0, latitude=47.5, seconds=0.0):
    """Level, 1000 m above the ground, with a camera that looks ahead and down."""
    return {
        2: round(1.7e15 + seconds * 1e6).to_bytes(8, "big"),
        5: linear(heading, 0, 360, 2),
        6: symmetric(0, 20, 2),
        7: symmetric(0, 50, 2),
        13: symmetric(latitude, 90, 4),
        14: symmetric(8.25, 180, 4),
        15: linear(1400, -900, 19000, 2),
        16: linear(40, 0, 180, 2),
        18: linear(azimuth, 0, 360, 4),
        19: symmetric(elevation, 180, 4),
        25: linear(400, -900, 19000, 2),
    }


def write(path, sets, period=0.2):
    with av.open(str(path), "w", format="mpegts") as out:
        video = out.add_stream("mpeg2video", rate=10)
        video.width, video.height, video.pix_fmt = 64, 48, "yuv420p"
        data = out.add_data_stream("klv")
        for number in range(20):
            frame = av.VideoFrame.from_ndarray(np.full((48, 64, 3), 9, np.uint8), format="rgb24")
            frame.pts = number
            out.mux(video.encode(frame))
            if number % 2 == 0 and number // 2 < len(sets):
                packet = av.Packet(sets[number // 2])
                packet.stream, packet.time_base = data, Fraction(1, 90_000)
                packet.pts = packet.dts = round(number // 2 * period * 90_000)
                out.mux(packet)
        out.mux(video.encode())
    return path


@pytest.mark.parametrize(("tag", "value"), EXAMPLES)
def test_values_are_those_of_the_standard(tag, value):
    name, expected = EXAMPLES[tag, value]
    for is_long in (False, True):  # BER-OID
        found = read_set(pack({tag: bytes.fromhex(value)}, is_long))[name]
        assert (
            found == expected
            if isinstance(expected, str)
            else found == pytest.approx(expected, rel=1e-7, nan_ok=True)
        )


def test_the_sample_packet_of_the_standard_is_read():
    assert read_set(SAMPLE + bytes.fromhex("aa43")) is None
    found = read_set(SAMPLE + bytes.fromhex("3e1e"))
    assert found["precision_time_stamp"] == 1231798102 * 10**6
    assert (found["mission_id"], found["image_source_sensor"]) == ("Mission 12", "EO Nose")
    assert found["frame_center_longitude"] == pytest.approx(29.157890122923, abs=1e-7)
    assert (len(found), found["version"]) == (22, 6)  # with security and a core identifier


def test_numbers_of_any_length_are_mapped():
    """ST 1201: -900 to 40000 in 3 bytes; the first bit stands for special values."""
    for value, expected in {"000000": -900.0, "2f921e": 23456.24, "c80000": np.nan}.items():
        found = read_set(pack({104: bytes.fromhex(value)}))["sensor_ellipsoid_height_extended"]
        assert found == pytest.approx(expected, abs=0.02, nan_ok=True)


def test_damaged_sets_are_counted_and_the_others_read():
    whole = pack({**aircraft(), 200: b"unknown", 3: b"x" * 200})
    wrong = bytearray(whole)
    wrong[40] ^= 1
    bare = whole[:-4]
    bare = bare[:17] + struct.pack(">H", len(bare) - 19) + bare[19:]  # without a checksum
    endless = KEY + b"\x84\xff\xff\xff\xff" + whole[20:60]
    stream = KlvStream()
    data = b"noise" + bytes(wrong) + whole + bare + endless + whole + whole[:50]
    for size in (1, 7, 1000):
        stream = KlvStream()
        parts = [data[n : n + size] for n in range(0, len(data), size)]
        found = [values for part in parts for values in stream.feed(part)]
        stream.finish()
        assert len(found) == 2
        assert stream.damaged == 4
        assert found[0]["sensor_latitude"] == pytest.approx(47.5)


def test_every_cut_is_read_as_far_as_it_goes():
    whole = pack(aircraft())
    for cut in range(len(whole)):
        stream = KlvStream()
        assert list(stream.feed(whole[:cut])) == []
        stream.finish()
        assert list(KlvStream().feed(whole[:cut] + whole)) != []


def test_a_film_has_the_poses_of_its_camera(tmp_path):
    """Its image's centre is 1000 m east of the aircraft, then south, by azimuth and heading."""
    sets = [pack(aircraft()), pack(aircraft(heading=100, azimuth=80, seconds=0.2))]
    path = write(tmp_path / "film.ts", [*sets, sets[1][:-1] + b"\x00"])
    faults = []
    series = {one.topic: one for one in telemetry_of(path, faults)}
    assert series.keys() == {"map_origin", "tf", "fix", "lens", "misb/uas_datalink"}
    assert faults == ["KLV metadata: 1 damaged set skipped"]
    origin = series["map_origin"].make(0)
    plane = LocalPlane(origin.latitude, origin.longitude, origin.altitude)
    np.testing.assert_allclose(plane.to_enu([47.5, 8.25, 400]), 0, atol=0.2)
    for number, expected in enumerate(([1000, 0], [0, -1000])):
        (found,) = series["tf"].make(number).transforms
        T = se3.from_pose(found.translation_xyz, found.quat_xyzw)
        met = LevelSurface().meet(T[:3, 3][None], T[:3, 2][None])[0]
        np.testing.assert_allclose(met[:2], expected, atol=2)
        assert rotations.to_matrix(found.quat_xyzw)[2, 0] == pytest.approx(0, abs=1e-6)  # level
    assert series["tf"].stamps_ns.tolist() == [0, 200_000_000, 400_000_000]  # the last one holds
    lens = series["lens"].make(0)
    assert (lens.width, lens.K[0, 0]) == (64, pytest.approx(32 / np.tan(np.radians(20)), rel=1e-3))
    with closing(open_source(path)) as recording:
        assert recording.topics["/misb/uas_datalink"].messages == 2
        logged = [e.message for e in recording.read(topics=["/misb/uas_datalink"])]
    assert logged[0].message.sensor_latitude == pytest.approx(47.5)
    declared = film(path)
    source = declared.make(StreamerParams(path=str(path)), Playback(rate=0, start_s=0.5))
    outputs = [output for output, _ in source.messages()]
    held = {*outputs[: outputs.index("image")]}  # what holds comes after a jump too
    assert {"map_origin", "lens"} <= held


def test_films_without_poses_say_nothing(tmp_path):
    for number, sets in enumerate(([], [b"noise"], [pack({3: b"only a name"})])):
        path = write(tmp_path / f"{number}.ts", sets)
        topics = {one.topic for one in telemetry_of(path)}
        assert topics == ({"misb/uas_datalink"} if number == 2 else set())
