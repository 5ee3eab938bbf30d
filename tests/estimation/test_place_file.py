"""Places beside a map: what was saved is loaded, and other files are refused in one line."""

import io
import zipfile

import numpy as np
import pytest

from ros_visualise.core.errors import OpenError
from ros_visualise.estimation.localization import map_file
from ros_visualise.estimation.localization.track import LandmarkTrack
from ros_visualise.estimation.visual.place_file import (
    PlaceLook,
    load_places,
    places_path,
    to_bytes,
)


def look(seed, count=70):
    random = np.random.default_rng(seed)
    return PlaceLook(
        random.integers(0, 256, (count, 32), dtype=np.uint8),
        random.normal(0, 0.3, (count, 2)),
        random.uniform(0.1, 1.0, count),
    )


LOOKS = [look(1), look(2, 90)]


def saved(folder, looks=LOOKS, data=None, names=None):
    """A map that lists places at z = their number, and the file beside it."""
    path, tracks = folder / "field.yaml", []
    for n, name in enumerate(names or [f"place_{one.id}" for one in looks]):
        at = np.array([0.0, 0, n]), np.eye(3), 0.01 * np.eye(6)
        tracks.append(LandmarkTrack.of_map((name, -1), at, np.zeros(3), 1))
    path.write_text(map_file.to_text("map", tracks))
    places_path(path).write_bytes(to_bytes(looks) if data is None else data)
    return path


def test_what_was_saved_is_loaded(tmp_path):
    found = load_places(saved(tmp_path))
    assert [one.look.id for one in found] == [one.id for one in LOOKS]
    for n, (place, was) in enumerate(zip(found, LOOKS, strict=True)):
        assert (place.look.descriptors == was.descriptors).all()
        np.testing.assert_allclose(place.look.rays, was.rays, atol=1e-6)
        np.testing.assert_allclose(place.look.inverse, was.inverse, rtol=1e-6)
        np.testing.assert_allclose(place.T_map_view[:3, 3], [0, 0, n - was.depth], atol=1e-5)


def test_a_map_without_places_needs_no_file(tmp_path):
    path = saved(tmp_path, names=["tag36h11_1"])
    places_path(path).unlink()
    assert load_places(path) == []


def test_places_that_the_map_dropped_are_not_loaded(tmp_path):
    (found,) = load_places(saved(tmp_path, names=[f"place_{LOOKS[1].id}"]))
    assert found.look.id == LOOKS[1].id


def changed(**arrays):
    """The file with other arrays."""
    stream = io.BytesIO()
    with np.load(io.BytesIO(to_bytes(LOOKS))) as old:
        np.savez(stream, **{**old, **arrays})
    return stream.getvalue()


def bomb():
    """A small file whose array has 64 MB when it is unpacked, and says that it has 600 bytes."""
    data = member(bytes(64 << 20), zipfile.ZIP_DEFLATED)
    assert len(data) < 100_000
    return data.replace((64 << 20).to_bytes(4, "little"), (600).to_bytes(4, "little"))


def member(counts, method=zipfile.ZIP_STORED, others=0):
    """An archive of one array, as these bytes, and of so many empty members."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive:
        archive.writestr("counts.npy", counts)
        for number in range(others):
            archive.writestr(str(number), b"")
    return stream.getvalue()


GOOD = to_bytes(LOOKS)
BAD = {
    "empty": b"",
    "text": b"landmarks: []\n",
    "cut": GOOD[: len(GOOD) // 2],
    "flipped": GOOD[:3000] + bytes([GOOD[3000] ^ 255]) + GOOD[3001:],
    "objects": changed(counts=np.array([None, 1], object)),
    "negative": changed(counts=np.array([-70, 230], np.int32)),
    "huge": changed(counts=np.array([2**31 - 1, 2**31 - 1], np.int32)),
    "short": changed(inverse=np.ones(3, np.float32)),
    "nan": changed(inverse=np.full(160, np.nan, np.float32)),
    "kind": changed(rays=np.zeros((160, 2))),
    "bomb": bomb(),
    "lzma": member(bytes(600), zipfile.ZIP_LZMA),
    "header": member(b"\x93NUMPY\x01\x00\x04\x00(((("),
    "members": member(b"", others=200),
    "none": changed(
        counts=np.zeros(0, np.int32),
        descriptors=np.zeros((0, 32), np.uint8),
        rays=np.zeros((0, 2), np.float32),
        inverse=np.zeros(0, np.float32),
    ),
}


WHY = {
    "bomb": "counts is compressed",
    "lzma": "counts is compressed",
    "members": "too large",
    "none": "no places, or",
}


@pytest.mark.parametrize("name", BAD)
def test_a_damaged_or_foreign_file_is_refused_in_one_line(tmp_path, name):
    with pytest.raises(OpenError, match=WHY.get(name, "places")) as error:
        load_places(saved(tmp_path, data=BAD[name]))
    said = str(error.value)
    assert said.startswith(f"{tmp_path}/field.places.npz: ")
    assert "\n" not in said
    assert len(said) < 400


def test_a_link_to_a_map_has_the_places_of_that_map(tmp_path):
    saved(tmp_path)
    link = tmp_path / "latest.yaml"
    link.symlink_to("field.yaml")
    assert len(load_places(link)) == 2
    places_path(link).unlink()
    with pytest.raises(OpenError, match=r"field\.places\.npz: no such file"):
        load_places(link)


def test_an_old_map_and_the_file_of_another_are_refused(tmp_path):
    path = saved(tmp_path, names=["place_7"])
    with pytest.raises(OpenError, match=r"contains no place of field\.yaml"):
        load_places(path)
    places_path(path).unlink()
    with pytest.raises(OpenError, match=r"field\.places\.npz: no such file"):
        load_places(path)
