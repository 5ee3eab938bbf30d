"""PDF files of figures: whole, with their font, and drawn as SVG draws them."""

import re
import zlib

import numpy as np
import pytest

from ros_visualise.data import Header, Path
from ros_visualise.plotting.colors import BLUE, RED
from ros_visualise.plotting.figure import Figure
from ros_visualise.plotting.pdf import font_widths
from ros_visualise.plotting.trajectory_plot import PlottedTrajectory, plot_trajectories


def objects(data):
    """Number -> content of each object, found by the table at the end of the file."""
    start = int(re.search(rb"startxref\n(\d+)\n%%EOF\n$", data)[1])
    places = [int(one) for one in re.findall(rb"(\d{10}) 00000 n ", data[start:])]
    found = {}
    for number, place in enumerate(places, 1):
        head = b"%d 0 obj\n" % number
        assert data[place:].startswith(head)
        found[number] = data[place + len(head) : data.index(b"\nendobj", place)]
    return found


def unpacked(content):
    head, _, rest = content.partition(b"stream\n")
    length = int(re.search(rb"/Length (\d+)", head)[1])
    return zlib.decompress(rest[:length])


@pytest.fixture
def figure():
    figure = Figure(400, 300)
    figure.line(np.array([[10.0, 20], [30, 40]]), BLUE, 2)
    figure.area(np.array([[1.0, 1], [5, 1], [5, 5]]), RED)
    figure.dot(100, 50, 4, RED)
    figure.text(200, 100, "x (m), 3 °", 12, "middle")
    figure.picture((0, 0, 40, 20), np.arange(24, dtype=np.uint8).reshape(2, 4, 3))
    return figure


def test_a_page_has_its_size_its_font_and_its_pictures(figure):
    found = objects(figure.pdf())
    assert b"/MediaBox [0 0 300.00 225.00]" in found[3]  # points
    assert unpacked(found[6])[:4] in (b"\0\1\0\0", b"true")  # a TrueType font
    assert b"/FontFile2 6 0 R" in found[5]
    assert b"/Width 4 /Height 2" in found[8]
    assert unpacked(found[8])[:3] == bytes([2, 1, 0])  # red, green, blue


def test_everything_is_drawn_where_it_is(figure):
    content = unpacked(objects(figure.pdf())[7]).decode()
    assert content.startswith("0.75 0 0 -0.75 0 225.00 cm")
    assert "2 w 10.00 20.00 m 30.00 40.00 l S" in content
    assert "1.00 1.00 m 5.00 1.00 l 5.00 5.00 l h f" in content
    assert "104.00 50.00 m" in content
    assert "40.00 0 0 -20.00 0.00 20.00 cm /P0 Do" in content
    x, text = re.search(r"1 0 0 -1 ([\d.]+) 100.00 Tm <(\w+)> Tj", content).groups()
    assert bytes.fromhex(text).decode("cp1252") == "x (m), 3 °"
    widths = [font_widths()[code - 32] for code in bytes.fromhex(text)]
    assert float(x) == pytest.approx(200 - 12 * sum(widths) / 2000, abs=0.01)


def way(times_s, shift=0.0):
    times_s = np.asarray(times_s, float)
    positions = np.stack([times_s, shift + np.sin(times_s), 0 * times_s], axis=1)
    stamps = np.rint(times_s * 1e9).astype(np.int64)
    quats = np.tile([0.0, 0, 0, 1], (len(times_s), 1))
    return Path(stamps, positions, quats, Header(int(stamps[-1]), "map"))


def drawn(figure, color):
    svg = figure.svg().decode()
    return re.findall(rf'<polyline points="([^"]*)"[^>]*stroke="{color}" stroke-width="1.8"', svg)


def test_gaps_are_not_bridged_and_each_path_has_its_start_and_end():
    gap = [*np.arange(0, 5, 0.1), *np.arange(20, 25, 0.1)]
    paths = [PlottedTrajectory("one", way(gap)), PlottedTrajectory("other", way(np.arange(9), 2))]
    figure = plot_trajectories(paths, ((0, 1),), "", True)
    assert len(drawn(figure, "#1f6fb2")) == 2 * 2  # two pieces, in the plane and over time
    assert len(drawn(figure, "#e27814")) == 2
    svg = figure.svg().decode()
    for color in ("#1f6fb2", "#e27814"):
        assert len(re.findall(rf'<circle [^>]*fill="{color}"', svg)) == 1
        assert len(re.findall(rf'<polygon [^>]*fill="{color}"', svg)) == 1


def test_without_times_there_are_no_gaps():
    path = way([0, 1, 2, 50, 51])
    figure = plot_trajectories([PlottedTrajectory("one", path)], ((0, 1),), "", False)
    assert len(drawn(figure, "#1f6fb2")) == 2


def test_a_narrow_figure_keeps_the_size_of_its_texts():
    path = [PlottedTrajectory("one", way(np.arange(9)))]
    narrow, wide = (plot_trajectories(path, ((0, 1),), "", True, w) for w in (333, 800))
    assert (narrow.width, wide.width) == (333, 800)
    for figure in (narrow, wide):
        sizes = set(re.findall(r'font-size="(\d+)"', figure.svg().decode()))
        assert sizes == {"11", "12", "15"}
