"""Lessons as a person meets them: the list, the page that is written, the page in the browser."""

import json
import re
import shlex
import sys
from pathlib import Path
from xml.etree import ElementTree as Xml

import cv2
import numpy as np
import pytest

from ros_visualise.commands import main
from ros_visualise.data import MarkerType
from ros_visualise.lessons import LESSONS
from ros_visualise.lessons.lesson import StepResult
from ros_visualise.lessons.prose import to_html
from ros_visualise.lessons.topics import color, graph


@pytest.fixture
def picture(tmp_path) -> Path:
    """A photo of someone's own: dots of all colours."""
    random = np.random.default_rng(3)
    pixels = cv2.GaussianBlur(random.integers(0, 256, (90, 120, 3), np.uint8), (0, 0), 1.5)
    path = tmp_path / "own <b>.png"
    cv2.imwrite(str(path), cv2.normalize(pixels, None, 0, 255, cv2.NORM_MINMAX))
    return path


def texts_of(page: Path) -> str:
    html = page.read_text(encoding="utf-8").removeprefix("<!DOCTYPE html>")
    return " ".join(Xml.fromstring(html).find("body").itertext())


def test_lessons_are_listed_with_a_sentence_each(capsys):
    assert main(["explain"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == LESSONS.names()
    assert all(LESSONS.find(line.split()[0]).about in line for line in lines)
    assert main(["explain", "--json"]) == 0
    assert list(json.loads(capsys.readouterr().out)) == LESSONS.names()


PICTURED = [topic for topic in LESSONS.names() if not LESSONS.find(topic).streams]


@pytest.mark.parametrize("topic", PICTURED)
def test_a_lesson_is_written_with_its_figures(topic, picture, tmp_path, capfd):
    folder = tmp_path / "out"
    assert main(["explain", topic, str(picture), "--export", str(folder)]) == 0
    page = folder / "index.html"
    html = page.read_text(encoding="utf-8")
    steps = [step.declared.name for step in LESSONS.find(topic).steps]
    for name in ("picture", *steps):
        assert f'src="{name}.' in html
    assert re.search('<html lang="en">', html)
    assert "@media print" in html
    assert not re.search(
        r"\b([Cc]lick|[Ss]lider|[Ww]atch them|3D view|this page)\b", texts_of(page)
    )
    for name in ("picture", *steps):
        assert Xml.parse(folder / f"{name}.svg").getroot().tag.endswith("svg")
        assert cv2.imread(str(folder / f"{name}.png")) is not None
    assert not re.search(
        "[{}]|nan", texts_of(page).partition("</style>")[2] or texts_of(page)[400:]
    )
    assert "said once" not in capfd.readouterr().err


def test_a_written_lesson_says_how_it_is_made_again(picture, tmp_path):
    chosen = ["--set", "thresholds.low=70", "--set", "gradient.l2=1", "--node", "filters@picture"]
    one, other = tmp_path / "one", tmp_path / "other"
    given = [*chosen, "--set", "filters.gray=false", "--export", str(one)]
    assert main(["explain", "canny", str(picture), *given]) == 0
    made = texts_of(one / "index.html").partition("How it was made")[2]
    assert "thresholds: low = 70, high = 140" in made
    assert "Inserted nodes filters@picture" in " ".join(
        re.sub("(Source|nodes|Parameters|Command)", r"\1 ", made).split()
    )
    words = shlex.split(made.partition("Command")[2])
    assert words[:4] == ["ros-visualise", "explain", "canny", str(picture)]
    assert "filters.gray=false" in words
    assert main([*words[1:], "--export", str(other)]) == 0
    assert (other / "index.html").read_bytes() == (one / "index.html").read_bytes()


@pytest.mark.usefixtures("opengl")
def test_all_lessons_are_written_with_a_list_of_them(picture, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(graph, "sleep", lambda seconds: None)
    folder = tmp_path / "all"
    few = ["image", "canny", "sensors"]
    monkeypatch.setattr(LESSONS, "names", lambda: few)
    assert main(["explain", "all", str(picture), "--export", str(folder)]) == 0
    links = re.findall('href="([^"]*)"', (folder / "index.html").read_text())
    assert links == [f"{name}/index.html" for name in few]
    assert all((folder / link).exists() for link in links)
    assert "the sample husky" in texts_of(folder / "sensors" / "index.html")
    assert str(picture) in texts_of(folder / "canny" / "index.html")
    capsys.readouterr()
    assert main(["explain", "all"]) == 2
    assert "explain all: add --export DIR" in capsys.readouterr().err


def test_a_lesson_is_printed_by_a_browser(picture, tmp_path, monkeypatch, capsys):
    arguments = ["explain", "canny", str(picture), "--export", str(tmp_path / "out"), "--pdf"]
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(arguments) == 2
    assert "PDF needs Chromium, Chrome or Edge on the PATH" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    browser = tmp_path / "chromium"
    browser.write_text(
        f"#!{sys.executable}\nimport sys\n"
        "pdf = next(one for one in sys.argv if one.startswith('--print-to-pdf='))\n"
        "open(pdf.partition('=')[2], 'w').write(sys.argv[-1])\n"
    )
    browser.chmod(0o755)
    assert main(arguments) == 0
    page = tmp_path / "out" / "index.html"
    assert page.with_suffix(".pdf").read_text() == page.as_uri()
    browser.write_text("#!/bin/sh\nexit 3\n")
    assert main([*arguments, "--overwrite"]) == 1
    assert "failed" in capsys.readouterr().err


@pytest.mark.parametrize("topic", ["color", "threshold", "canny"])
@pytest.mark.parametrize("shape", [(1, 1), (3, 1), (20, 30, 3)])
def test_a_picture_without_anything_in_it_is_explained_too(topic, shape, tmp_path, capfd):
    flat = tmp_path / "flat.png"
    cv2.imwrite(str(flat), np.full(shape, 200, np.uint8))
    assert main(["explain", topic, str(flat), "--export", str(tmp_path / "out")]) == 0
    assert "Warning" not in capfd.readouterr().err


def test_the_picture_may_be_ones_own(picture, tmp_path):
    folder = tmp_path / "out"
    arguments = ["explain", "canny", str(picture), "--export", str(folder)]
    settings = [
        "--set",
        "thresholds.low=70",
        "--set",
        "smoothing.sigma=0",
        "--set",
        "gradient.l2=1",
    ]
    assert main([*arguments, *settings]) == 0
    gray = cv2.cvtColor(cv2.imread(str(picture)), cv2.COLOR_BGR2GRAY)
    edges = cv2.Canny(gray, 70, 140, L2gradient=True)
    text = texts_of(folder / "index.html")
    assert f"So {np.count_nonzero(edges)} pixels are edges" in text
    assert f"differs in 0 of {edges.size} pixels" in text
    drawn = cv2.imread(str(folder / "hysteresis.png"))
    is_edge = (drawn == 255).all(axis=2) | (drawn[..., 1] == 220)
    assert (is_edge == (edges > 0)).all()


def test_the_gradient_is_told_along_the_row_of_the_pixel_that_is_chosen(picture, tmp_path):
    chosen = ["--set", "profile.x=50", "--set", "profile.y=20"]
    folder = tmp_path / "out"
    assert main(["explain", "gradient", str(picture), "--export", str(folder), *chosen]) == 0
    row = cv2.cvtColor(cv2.imread(str(picture)), cv2.COLOR_BGR2GRAY)[20].astype(int)
    words = f"At x = 50 (orange): ({row[51]} − {row[49]}) / 2 = {(row[51] - row[49]) / 2:+.1f}"
    text = texts_of(folder / "index.html")
    assert "Along row 20" in text
    assert words in text


def test_a_pixel_stands_in_the_cube_where_its_colour_says(landscape):
    image = StepResult(landscape, "bgr8", work=landscape)
    markers = color.cube(image, color.CubeParams())["markers"].markers
    dots = next(one for one in markers if one.type == MarkerType.POINTS)
    assert (dots.points_xyz / color._SIDE + 0.5) * 255 == pytest.approx(
        dots.colors_rgba[:, :3] * 255, abs=1e-3
    )
    named = {one.text: one.position_xyz for one in markers if one.text}
    assert (named["white"] > 0).all()
    assert (np.sign(named["green"]) == [-1, 1, -1]).all()


def test_a_lesson_that_is_refused_leaves_no_folder(tmp_path):
    wanted = tmp_path / "new" / "out"
    assert main(["explain", "canny", str(tmp_path / "no.png"), "--export", str(wanted)]) == 2
    assert not list(tmp_path.iterdir())


def test_what_was_written_before_stays_unless_told_otherwise(picture, tmp_path, capsys):
    arguments = ["explain", "canny", str(picture), "--export", str(tmp_path / "out")]
    assert main(arguments) == 0
    capsys.readouterr()
    assert main(arguments) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert main([*arguments, "--overwrite"]) == 0


def test_wrong_names_are_answered_in_one_line(tmp_path, capsys):
    for arguments, words in {
        ("cany",): "did you mean canny?",
        ("canny", str(tmp_path / "none.png")): "no such file",
        ("canny", "--export", "/dev/null/x"): "/dev/null/x",
    }.items():
        assert main(["explain", *arguments, "--view", "none", "--frames", "1"]) in (1, 2)
        err = capsys.readouterr().err
        assert words in err
        assert "Traceback" not in err


def test_texts_are_shown_as_they_are_written():
    html = to_html("A <b>name</b>\ngoes on & on.\n\n    a  =  b < c\n    d\n\nEnd")
    blocks = [
        "<p>A &lt;b&gt;name&lt;/b&gt; goes on &amp; on.</p>",
        '<pre tabindex="0">a  =  b &lt; c',
        "d</pre>",
    ]
    assert html.splitlines() == [*blocks, "<p>End</p>"]
