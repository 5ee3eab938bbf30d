import numpy as np
import pytest

from ros_visualise.core.errors import ParameterError, UnsupportedImage
from ros_visualise.core.params import specs, update
from ros_visualise.data import ENCODINGS, MEASUREMENTS, Deferred, Header, Image
from ros_visualise.nodes import edge_detector as module
from ros_visualise.nodes import find
from ros_visualise.nodes.edge_detector import EdgeParams, edge_detector

cv2 = pytest.importorskip("cv2")

HEADER = Header(123, "camera")
PLAIN = [name for name in ENCODINGS if not name.startswith("bayer")]
METHODS = ["canny", "sobel", "scharr", "laplacian"]


def run(image, **changes):
    return edge_detector(image, update(EdgeParams(), changes))


@pytest.fixture
def scene():
    """A bright disc and a dark box on a plain ground."""
    pixels = np.full((60, 80), 120, np.uint8)
    cv2.circle(pixels, (25, 30), 14, 250, -1)
    pixels[15:45, 50:70] = 10
    return pixels


def in_encoding(gray, encoding):
    """The gray picture in another encoding."""
    dtype, channels = ENCODINGS[encoding]
    pixels = gray.astype(dtype) * np.array(np.iinfo(dtype).max // 255, dtype)
    return Image(np.dstack([pixels] * channels) if channels > 1 else pixels, encoding, HEADER)


def test_what_it_publishes_is_the_edges(scene):
    image = Image(scene, "mono8", HEADER)
    found = run(image)["edges"]
    assert np.array_equal(found.pixels, cv2.Canny(scene, 100, 200))
    assert (found.encoding, found.header) == ("mono8", HEADER)
    assert not np.array_equal(found.pixels, scene)
    assert set(np.unique(found.pixels)) == {0, 255}


@pytest.mark.parametrize("encoding", PLAIN)
def test_every_encoding_gives_the_same_edges(scene, encoding):
    image = in_encoding(scene, encoding)
    for method in METHODS:
        changes = {"method": method, "sigma": 1.0, "low": 50, "high": 150}
        expected = run(Image(scene, "mono8"), **changes)["edges"].pixels
        found = run(image, **changes)["edges"].pixels
        assert expected.any()
        if method == "canny":
            agree = (found == expected).mean()
            assert agree > 0.99
        else:
            tolerance = 8 if ENCODINGS[encoding][0] == "uint16" else 0
            assert np.abs(found.astype(int) - expected).max() <= tolerance
        assert found.shape == scene.shape


def test_colour_is_made_gray_first():
    red_on_blue = np.zeros((20, 20, 3), np.uint8)
    red_on_blue[..., 0] = 255
    red_on_blue[5:15, 5:15] = (0, 0, 255)
    gray = cv2.cvtColor(red_on_blue, cv2.COLOR_BGR2GRAY)
    found = run(Image(red_on_blue, "bgr8"), low=50, high=100)["edges"].pixels
    assert found.any()
    assert np.array_equal(found, cv2.Canny(gray, 50, 100))
    swapped = Image(red_on_blue[..., ::-1].copy(), "rgb8")
    assert np.array_equal(run(swapped, low=50, high=100)["edges"].pixels, found)


@pytest.mark.parametrize("encoding", ["bayer_rggb8", "bayer_grbg16"])
def test_a_mosaic_is_refused_by_name(encoding):
    image = Image(np.zeros((4, 4), ENCODINGS[encoding][0]), encoding)
    with pytest.raises(UnsupportedImage, match=rf"{encoding}.*demosaic"):
        run(image)


def test_the_parameters_reach_canny():
    noise = np.random.default_rng(1).normal(128, 40, (60, 80)).clip(0, 255).astype(np.uint8)
    image = Image(noise, "mono8")
    changes = {"low": 800, "high": 400, "aperture": "5", "l2_gradient": True, "sigma": 1.1}
    smooth = cv2.GaussianBlur(noise, (0, 0), 1.1)
    expected = cv2.Canny(smooth, 400, 800, apertureSize=5, L2gradient=True)
    found = run(image, **changes)["edges"].pixels
    assert expected.any()
    assert np.array_equal(found, expected)
    for name in changes:
        without = {key: value for key, value in changes.items() if key != name}
        assert not np.array_equal(run(image, **without)["edges"].pixels, expected), name


def test_min_gradient_and_auto(scene):
    image = Image(scene, "mono8")
    every = run(image)["edges"].pixels
    strong = run(image, min_gradient=460)["edges"].pixels
    assert 0 < (strong > 0).sum() < (every > 0).sum()
    assert (every[strong > 0] == 255).all()
    faint = Image(scene // 10, "mono8")
    assert not run(faint)["edges"].pixels.any()
    assert run(faint, auto=True)["edges"].pixels.any()


@pytest.mark.parametrize("method", ["sobel", "scharr", "laplacian"])
def test_low_and_high_are_black_and_white_of_a_strength(scene, method):
    image = Image(scene, "mono8")
    found = run(image, method=method, low=0, high=800)["edges"].pixels
    assert len(np.unique(found)) > 3
    binary = run(image, method=method, low=400, high=400)["edges"].pixels
    assert np.array_equal(binary == 255, found > 400 / 800 * 255)


def test_the_overlay_is_made_when_it_is_read_and_only_once(scene, monkeypatch):
    calls = []
    draw = module.draw_over
    monkeypatch.setattr(module, "draw_over", lambda *args: calls.append(1) or draw(*args))
    image = in_encoding(scene, "rgb16")
    answer = run(image, overlay_color="green")
    overlay, edges = answer["edges_overlay"], answer["edges"].pixels > 0
    assert isinstance(overlay.data, Deferred)
    assert (overlay.width, overlay.height, overlay.encoding) == (80, 60, "bgr8")
    assert calls == []
    assert (overlay.pixels[edges] == (0, 255, 0)).all()
    assert np.array_equal(overlay.pixels[~edges], np.dstack([scene] * 3)[~edges])
    assert calls == [1]
    assert overlay.header == HEADER


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (7, 1), (5, 3), (101, 67)])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("aperture", ["3", "5", "7"])
def test_every_kind_and_size(size, method, aperture):
    noise = np.random.default_rng(2).integers(0, 256, size).astype(np.uint8)
    changes = {"method": method, "aperture": aperture, "sigma": 0.8, "min_gradient": 10}
    for encoding in PLAIN:
        for auto in (False, True):
            answer = run(in_encoding(noise, encoding), **changes, auto=auto)
            assert answer["edges"].pixels.shape == size
            assert answer["edges_overlay"].pixels.shape == (*size, 3)


def test_the_declaration():
    declared = find("edge_detector")
    assert list(declared.outputs) == ["edges", "edges_overlay"]
    assert declared.on_demand == {"edges_overlay"}
    known = {spec.name: spec for spec in specs(EdgeParams)}
    assert [known[name].default for name in ("low", "high")] == [100, 200]
    assert all(known[name].range == (0, 800) for name in ("low", "high", "min_gradient"))
    assert known["aperture"].choices == ("3", "5", "7")
    with pytest.raises(ParameterError, match="from 0 to 800"):
        update(EdgeParams(), {"low": 801})


@pytest.mark.parametrize("encoding", MEASUREMENTS)
def test_measurements_are_refused_by_name(encoding):
    dtype, channels = MEASUREMENTS[encoding]
    pixels = np.ones((3, 5) if channels == 1 else (3, 5, channels), dtype)
    with pytest.raises(UnsupportedImage, match=f"{encoding} holds measurements"):
        run(Image(pixels, encoding))
