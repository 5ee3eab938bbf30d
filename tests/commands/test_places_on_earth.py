"""`ros-visualise landmarks SRC --geo OUT`: pictures of a drone to files for maps, as typed."""

import csv
import json

import av
import numpy as np
import PIL.Image
import pytest

from ros_visualise.commands import main
from ros_visualise.commands.landmarks import LandmarksOptions
from ros_visualise.commands.landmarks.graph import landmark_graph
from ros_visualise.commands.landmarks.places import PlaceLog
from ros_visualise.data import (
    Detection3D,
    Detections3D,
    Header,
    Hypothesis,
    NavSatFix,
    Transforms,
    TransformStamped,
)
from ros_visualise.geometry.geodesy import LocalPlane
from ros_visualise.landmarks.tags import draw_cells, family
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.queues import Packet
from ros_visualise.sinks import open_recorder

XMP = (
    '<d drone-dji:RelativeAltitude="+40.0" drone-dji:AbsoluteAltitude="+140.0"'
    ' drone-dji:GimbalYawDegree="90.0" drone-dji:GimbalPitchDegree="-90.0"'
    ' drone-dji:GimbalRollDegree="0.0"/>'
)
PLACE = (47.5, 8.25)
LEVEL = np.array([0.0, 0, 0, 1])
FOCAL_PX = 24 / np.hypot(36, 24) * 1000
CELL_PX = 6


def write(path, u, v, east=0.0, xmp=XMP, gps=True):
    """A picture of a tag at a pixel, from 40 m above the ground, east of the place."""
    pixels = np.full((600, 800), 200, np.uint8)
    cells, _ = draw_cells(family("tag36h11"), 3)
    tag = np.kron(np.where(cells, 220, 30).astype(np.uint8), np.ones((CELL_PX, CELL_PX), np.uint8))
    half = len(tag) // 2
    pixels[v - half : v + half, u - half : u + half] = tag[: 2 * half, : 2 * half]
    exif = PIL.Image.Exif()
    exif[0x0110] = "FC7303"
    if gps:
        latitude, longitude, _ = LocalPlane(*PLACE).from_enu([east, 0, 0])
        place = exif.get_ifd(0x8825)
        place[1], place[2] = "N", (float(latitude), 0.0, 0.0)
        place[3], place[4] = "E", (float(longitude), 0.0, 0.0)
    PIL.Image.fromarray(pixels).save(path, exif=exif, xmp=xmp.encode(), quality=95)


@pytest.fixture
def find(monkeypatch, capsys):
    """Run the command on what is given; its status and its errors."""
    monkeypatch.setattr("signal.signal", lambda *_: None)

    def find(*arguments):
        status = main(["landmarks", *map(str, arguments), "--model", "none"])
        return status, capsys.readouterr().err

    return find


def test_a_tag_in_two_pictures_is_one_place(find, tmp_path):
    folder, out = tmp_path / "pictures", tmp_path / "out.csv"
    folder.mkdir()
    ahead = round(10 / 40 * FOCAL_PX)  # 10 m east, which is up in the image
    write(folder / "1.jpg", 400, 300 - ahead)
    write(folder / "2.jpg", 400, 300, east=10.0)
    status, said = find(folder, "--geo", out)
    assert status == 0
    assert f"{out}: 1 place" in said
    (row,) = csv.DictReader(out.read_text().splitlines())
    assert (row["name"], row["seen"]) == ("tag36h11_3", "2")
    place = [float(row[name]) for name in ("latitude", "longitude", "height")]
    np.testing.assert_allclose(LocalPlane(*PLACE, 100).to_enu(place), [10, 0, 0], atol=0.15)
    assert 3 < float(row["sd_east_m"]) < 4  # that of the position is not known: 3 m
    out = tmp_path / "out.geojson"
    status, _ = find(folder, "--geo", out, "--set", "georeference.position_sigma=0.1", "--json")
    kinds = [one["geometry"]["type"] for one in json.loads(out.read_text())["features"]]
    assert (status, kinds) == (0, ["Point", "Polygon", "LineString"])


def test_what_cannot_be_placed_is_said_in_a_line(find, tmp_path):
    out = tmp_path / "out.kml"
    level = XMP.replace("-90.0", "0.0")
    for number, (values, reason, status) in enumerate(
        (
            ({"gps": False}, "--geo: needs fixes", 2),
            ({"xmp": ""}, "--geo: needs tf", 2),
            ({"xmp": level, "v": 100}, "1 above the horizon", 1),
            (
                {"xmp": XMP.replace("drone-dji:Rel", "drone-dji:Other")},
                "the height above the ground is unknown",
                1,
            ),
        )
    ):
        picture = tmp_path / f"{number}.jpg"
        write(picture, **{"u": 400, "v": 300, **values})
        found, said = find(picture, "--geo", out)
        assert reason in said
        assert (found, out.exists()) == (status, False)
    assert "give a name that ends in .geojson" in find(picture, "--geo", tmp_path / "a.shp")[1]
    assert find(picture, "--geo", picture)[0] == 2


def test_a_film_gets_its_poses_from_a_recording_beside_it(find, tmp_path, caplog):
    """Its camera is fixed to the body, which flies 20 m high; the film starts 0.5 s later."""
    film, beside, out = (tmp_path / name for name in ("film.mp4", "log.mcap", "out.csv"))
    picture = tmp_path / "1.png"
    write(picture, 400, 300)
    with av.open(str(film), "w") as container:
        stream = container.add_stream("mpeg4", rate=10)
        stream.width, stream.height, stream.bit_rate = 800, 600, 8_000_000
        for _ in range(5):
            container.mux(stream.encode(av.VideoFrame.from_image(PIL.Image.open(picture))))
        container.mux(stream.encode())
    kinds = {"/fix": NavSatFix, "/tf": Transforms}
    types = {topic: TopicType(kind.type_name) for topic, kind in kinds.items()}
    recorder = open_recorder(beside, types, live=False)
    fixes = tmp_path / "fixes.mcap"
    only_fixes = open_recorder(fixes, {"/fix": types["/fix"]}, live=False)
    for number in range(20):
        stamp_ns, east = number * 10**8, float(number)
        place = LocalPlane(*PLACE, 100).from_enu([east, 0, 20])
        fix = NavSatFix(*place, np.eye(3), 2, header=Header(stamp_ns, "gps"))
        body = np.array([east, 0.0, 20.0]), np.array([0.0, 0, 0, 1])
        pose = TransformStamped("base_link", *body, Header(stamp_ns, "map"))
        recorder.write("/fix", fix, stamp_ns)
        only_fixes.write("/fix", fix, stamp_ns)
        recorder.write("/tf", Transforms((pose,)), stamp_ns)
    recorder.close()
    only_fixes.close()
    status, said = find(film, "--beside", fixes, "--geo", out)
    assert status == 2
    assert f"--geo: no valid positions with attitudes in {fixes}; give another log" in said
    options = ["--beside", beside, "--offset", "film=0.5", "--set", "georeference.lens=70"]
    assert find(film, *options, "--geo", out)[0] == 0
    assert "assumed fixed to base_link, 90 degrees below" in caplog.text
    (row,) = csv.DictReader(out.read_text().splitlines())
    place = [float(row[name]) for name in ("latitude", "longitude", "height")]
    np.testing.assert_allclose(LocalPlane(*PLACE, 100).to_enu(place), [7, 0, 0], atol=0.3)
    assert find(film, "--offset", "film=1", "--geo", out, "--overwrite")[0] == 2
    assert find(film, *options, "--offset", "other=1", "--geo", out, "--overwrite")[0] == 2


def test_objects_that_are_followed_have_tracks(tmp_path):
    """Two cars, of which one drives: their ids keep them apart, however near they are."""
    write(tmp_path / "1.jpg", 400, 300)
    model = str(tmp_path / "any.onnx")
    options = LandmarksOptions(
        input=str(tmp_path / "1.jpg"), geo=tmp_path / "o.kml", tracks=True, model=model
    )
    graph = landmark_graph(options)
    (node,) = [one for one in graph.nodes if one.name == "georeference"]
    assert node.inputs["objects"] == "/tracks"
    log = PlaceLog(graph)

    def tell(port, message, topics):
        log.listeners[topics[port]].put(Packet(0, message, 0))

    origin = NavSatFix(*PLACE, 400.0, header=Header(0, "map"))
    tell("map_origin", origin, node.outputs)
    for number in range(5):
        at = {"1": [10.0, 0, 0], "2": [12.0 + 3 * number, 1, 0]}
        cars = tuple(
            Detection3D(np.array(xyz), LEVEL, np.zeros(3), (car(xyz),), id)
            for id, xyz in at.items()
        )
        tell("positions", Detections3D(cars, Header(number * 10**9, "map")), node.outputs)
    places, tracks = log.found()
    assert [one.name for one in places] == ["car #1", "car #2"]
    assert [one.name for one in tracks] == ["car #1", "car #2"]
    enu = LocalPlane(*PLACE, 400).to_enu(tracks[1].places)
    np.testing.assert_allclose(enu[:, 0], [12, 15, 18, 21, 24], atol=1e-3)
    np.testing.assert_allclose(places[1].place, tracks[1].places[-1])


def car(xyz):
    return Hypothesis("car", 0.9, np.array(xyz), LEVEL, 25 * np.eye(6))
