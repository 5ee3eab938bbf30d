"""What the made pictures show, and what their labels say."""

import json
from pathlib import Path

import cv2
import numpy as np
import pads
import pytest
from outlines import View
from pads import SIDE, draw_pad, to_pixels
from pictures import render_world, write_world
from shots import see, take_shot
from worlds import CLASSES, OTHER, build_world

from ros_visualise.core.errors import OpenError

pytest.importorskip("mujoco")
SIZE = 320, 240


@pytest.fixture(scope="module")
def world():
    return build_world(np.random.default_rng(4))


def test_there_is_every_class_and_what_is_none(world):
    assert {thing.kind for thing in world.things} == {OTHER, *range(len(CLASSES))}


def test_a_board_stands_on_a_gray_pole_and_is_no_landmark(world):
    model = world.model
    boards = [each for each in world.things if "board" in model.body(each.body).name]
    assert len(boards) > 1
    for board in boards:
        assert board.kind == OTHER
        heights = np.concatenate(board.parts)[:, 2]
        assert heights.min() == pytest.approx(0, abs=1e-6)
        assert heights.max() > 0.4
        (pole,) = (
            number
            for number in np.flatnonzero(model.geom_bodyid == board.body)
            if model.geom_matid[number] < 0
        )
        red, green, blue, _ = model.geom_rgba[pole]
        assert red == green == blue


def test_no_board_is_seen_from_the_side(world):
    """From there its thin coloured edge would look like a post."""
    random, cosines = np.random.default_rng(2), []
    boards = [each for each in world.things if each.kind == OTHER and each.facing is not None]
    assert len(boards) > 1
    for _ in range(100):
        view, _ = take_shot(world, random, SIZE)
        for board in boards:
            shown = world.model.geom_group[world.model.geom_bodyid == board.body] == 0
            if shown.all():
                ahead = view.position_xyz - world.data.xpos[board.body]
                R = world.data.xmat[board.body].reshape(3, 3)
                cosines.append(abs(R @ board.facing @ ahead) / np.linalg.norm(ahead))
    assert len(cosines) > 10
    assert min(cosines) > 0.35


def test_the_edge_of_a_tags_board_is_gray(world):
    model = world.model
    for board in (each for each in world.things if each.free):
        edges = model.geom_rgba[(model.geom_bodyid == board.body) & (model.geom_matid < 0)]
        assert len(edges) == 1
        assert len(set(edges[0, :3])) == 1


def test_labels_are_in_the_picture_and_about_three_of_ten_have_none(world):
    random = np.random.default_rng(1)
    shots = [take_shot(world, random, SIZE) for _ in range(200)]
    for view, seen in shots:
        assert 0.5 < view.position_xyz[2] < 60.1
        for one in seen:
            assert 0 < one.share <= 1
            assert (one.box[:2] >= -0.501).all()
            assert (one.box[2:] <= np.array(SIZE) - 0.499).all()
            assert (one.box[2:] > one.box[:2]).all()
    empty = np.mean([not seen for _, seen in shots])
    assert 0.25 < empty < 0.5  # with those whose landmark is hidden
    kinds = {one.kind for _, seen in shots for one in seen}
    assert kinds == set(range(len(CLASSES)))


def test_a_pad_seen_from_above_is_where_it_was_drawn(world):
    """The box is that of what is painted, not of the plate that it is painted on."""
    import mujoco

    pad = next(thing for thing in world.things if thing.kind == CLASSES.index("helipad"))
    world.model.body_pos[pad.body] = (3.0, -2.0, 0.0)
    world.model.body_quat[pad.body] = (1, 0, 0, 0)
    mujoco.mj_kinematics(world.model, world.data)
    view = View(np.array([3.0, -2.0, 20.0]), np.diag([1.0, -1.0, -1.0]), 200.0, SIZE)
    for other in world.things:
        world.model.geom_group[world.model.geom_bodyid == other.body] = 5
    world.model.geom_group[world.model.geom_bodyid == pad.body] = 0
    seen = see(world, view, pad, np.random.default_rng(0))
    assert seen is not None
    outline = pad.parts[0]
    depth = 20.0 - outline[0, 2]
    low, high = outline[:, :2].min(axis=0), outline[:, :2].max(axis=0)
    middle = (np.array(SIZE) - 1) / 2
    want = [low[0], -high[1], high[0], -low[1]] * np.array(200 / depth) + np.tile(middle, 2)
    np.testing.assert_allclose(seen.box, want, atol=0.01)
    np.testing.assert_allclose(seen.point, middle, atol=1e-6)
    assert seen.share == 1


@pytest.mark.parametrize("held_out", [False, True])
def test_a_pads_outline_reaches_as_far_as_its_paint(
    monkeypatch: pytest.MonkeyPatch, held_out: bool
):
    """To each side, in pixels of the drawing; decorations may reach over the frame."""
    monkeypatch.setattr(pads, "draw_surface", lambda *_: np.full((SIDE, SIDE, 3), 100, np.uint8))
    monkeypatch.setattr(pads, "_decorate", lambda *_: None)
    monkeypatch.setattr(pads, "_wear", lambda _, paint, __: paint)
    for seed in range(80):
        drawn = draw_pad(np.random.default_rng(seed), held_out)
        painted = (drawn.picture != drawn.picture[0, 0]).any(axis=2)
        x, y, wide, high = cv2.boundingRect(painted.astype(np.uint8))
        uv = to_pixels(drawn.outline_xy) / 16
        ends = [x, y, x + wide - 1, y + high - 1]
        np.testing.assert_allclose([*uv.min(axis=0), *uv.max(axis=0)], ends, atol=2.5)


def test_a_body_of_a_mjcf_file_is_a_class(tmp_path: Path):
    """Its name is the class's, and its boxes are drawn around its geoms."""
    file = tmp_path / "windsock.xml"
    file.write_text(
        '<mujoco><worldbody><body name="windsock"><geom type="cylinder" size=".05 2" pos="0 0 2"/>'
        '<body pos="0 0 4"><geom type="capsule" size=".2 .5" euler="0 90 0" pos=".5 0 0"/></body>'
        "</body></worldbody></mujoco>"
    )
    world = build_world(np.random.default_rng(0), own=[file])
    assert world.classes == (*CLASSES, "windsock")
    (sock,) = (thing for thing in world.things if thing.kind == len(CLASSES))
    points = np.vstack(sock.parts)
    np.testing.assert_allclose(points.min(axis=0), [-0.2, -0.2, 0], atol=0.01)
    np.testing.assert_allclose(points.max(axis=0), [1.2, 0.2, 4.2], atol=0.01)
    random, seen = np.random.default_rng(2), []
    while not any(one.kind == len(CLASSES) for one in seen):
        seen = take_shot(world, random, SIZE)[1]


def test_a_file_without_a_body_says_what_it_lacks(tmp_path: Path):
    file = tmp_path / "nothing.xml"
    file.write_text("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    with pytest.raises(OpenError, match=r"nothing\.xml: its <worldbody> needs a <body>"):
        build_world(np.random.default_rng(0), own=[file])


@pytest.mark.usefixtures("opengl")
def test_the_same_seed_gives_the_same_pictures_and_another_others(tmp_path: Path):
    for folder in ("a", "b"):
        write_world(tmp_path / folder, (3, 1), count=2, size=(96, 96))
    one, two = (json.loads((tmp_path / folder / "labels.json").read_text()) for folder in "ab")
    assert one == two
    assert one["classes"] == list(CLASSES)
    files = [(tmp_path / folder / "0001.jpg").read_bytes() for folder in "ab"]
    assert files[0] == files[1]
    first = cv2.imread(str(tmp_path / "a" / "0001.jpg"))[..., ::-1]
    other = next(render_world((2, 0), 1, (96, 96)))[0]
    assert np.abs(first.astype(int) - other).mean() > 5
