"""Maps, particles and outlines in the scene."""

import cv2
import numpy as np
import pytest
from scene_messages import LEFT, LEVEL, S, draw, has, is_at, tf, transform

from ros_visualise.data import Header, OccupancyGrid, PolygonStamped, PoseArray
from ros_visualise.ui.scene.drawing import Appearance
from ros_visualise.ui.scene.drawings.grids import Scheme, depth_of, palette_of, picture_of
from ros_visualise.ui.scene.drawings.particles import arrows_of

GRAY_GREEN = [0x70, 0x89, 0x86]
CELLS = np.full((30, 40), -1, np.int8)
CELLS[2:20, 3:30] = 0
CELLS[2, 3], CELLS[29, 39], CELLS[10, 20] = 100, 100, 50


def grid(cells=CELLS, frame="map", stamp_s=1.0, xyz=(0, 0, 0), quat=LEVEL, resolution=0.5):
    header = Header(int(stamp_s * S), frame)
    return OccupancyGrid(cells, resolution, np.array(xyz, float), quat, header=header)


def pixels_of(node):
    """Of an image of the scene, RGB; the first row is that of the cells, which is at its bottom."""
    data = cv2.imdecode(np.frombuffer(node["image"], np.uint8), cv2.IMREAD_COLOR)
    return cv2.cvtColor(data, cv2.COLOR_BGR2RGB)[::-1]


def test_a_cell_has_its_color_and_its_place(scene, look):
    draw(scene, map=grid())
    pixels = pixels_of(look("topics/map/cells"))
    side = len(pixels) // 30
    assert pixels.shape == (30 * side, 40 * side, 3)
    middles = pixels[side // 2 :: side, side // 2 :: side]
    assert middles[2, 3].tolist() == [0, 0, 0]
    assert middles[10, 20].tolist() == [128, 128, 128]
    assert middles[2, 4].tolist() == [255, 255, 255]
    assert middles[0, 0].tolist() == middles[29, 0].tolist() == GRAY_GREEN
    assert (pixels[:side, :side] == GRAY_GREEN).all()


def test_a_map_lies_at_its_origin_in_its_frame(scene, look):
    draw(scene, tf=tf(transform("map", "odom", [10, 0, 0], 1)))
    draw(scene, map=grid(frame="odom", xyz=[1, 2, 3], quat=LEFT))
    look("topics/map", is_at([10, 0, 0]))
    depth = depth_of(20.0, Scheme.MAP)
    node = look("topics/map/cells", is_at([1 - 7.5, 2 + 10, 3 - depth]))  # x turned left
    assert np.allclose(node["wxyz"], np.roll(LEFT, 1))
    assert (node["width"], node["height"]) == (20.0, 15.0)
    assert 0 < depth < 0.1


def test_a_map_that_does_not_change_is_not_sent_again(scene, look):
    draw(scene, map=grid())
    before = look("topics/map/cells", lambda node: "image" in node)["image"]
    draw(scene, map=grid(CELLS.copy(), stamp_s=2.0, xyz=[7, 0, 0]))
    scene.appearance = Appearance(axes_size=2.0)
    scene.refresh()
    node = look("topics/map/cells", lambda node: node["position"][0] == 17)
    assert node["image"] is before
    changed = CELLS.copy()
    changed[0, 0] = 0
    draw(scene, map=grid(changed, stamp_s=3.0))
    node = look("topics/map/cells", lambda node: node["image"] is not before)
    assert pixels_of(node)[0, 0].tolist() == [255, 255, 255]


def test_a_map_moves_with_its_frame_until_the_next_comes(scene, look):
    draw(scene, tf=tf(transform("map", "odom", [1, 0, 0], 1)), grid=grid(frame="odom"))
    look("topics/grid", is_at([1, 0, 0]))
    draw(scene, tf=tf(transform("map", "odom", [2, 0, 0], 9)))
    look("topics/grid", is_at([2, 0, 0]))


def test_a_map_that_comes_before_its_transform_is_drawn_when_that_is_there(scene, look, clock):
    draw(scene, tf=tf(transform("odom", "base_link", [0, 0, 0], 1)), map=grid())
    clock.now_s = 1.0
    scene.refresh()
    assert "map" in scene.problems["/map"]
    assert not scene.is_waiting("/map")
    scene.set_fixed("odom")
    draw(scene, tf=tf(transform("map", "odom", [3, 0, 0], 1)))
    look(
        "topics/map", lambda node: node.get("visible") and np.allclose(node["position"], [-3, 0, 0])
    )
    assert scene.problems == {}


def test_costs_have_the_colors_of_rviz_where_the_topic_is_a_costmap_or_a_person_says_so(
    scene, look
):
    cells = np.array([[0, 1, 98], [99, 100, -1]], np.int8)
    draw(scene, **{"local_costmap/costmap": grid(cells), "map": grid(cells)})

    def colors(name):
        pixels = pixels_of(look(f"topics/{name}/cells"))
        side = len(pixels) // 2
        return pixels[side // 2 :: side, side // 2 :: side].reshape(6, 3).tolist()

    white, black = [255, 255, 255], [0, 0, 0]
    costs = [white, [2, 0, 253], [249, 0, 6], [0, 255, 255], [255, 0, 255], GRAY_GREEN]
    assert colors("local_costmap.costmap") == costs
    gray = colors("map")
    assert (gray[0], gray[4], gray[5]) == (white, black, GRAY_GREEN)
    before = look("topics/map/cells")["image"]
    scene.set_coloring("/map", Scheme.COSTS)
    scene.refresh()
    look("topics/map/cells", lambda node: node["image"] is not before)
    assert colors("map") == costs


def test_what_is_no_occupancy_is_told_by_its_color():
    palette = palette_of(Scheme.MAP)
    assert palette[101].tolist() == palette[127].tolist() == [0, 255, 0]
    assert palette[128].tolist() == [255, 0, 0]
    assert palette[254].tolist() == [255, 255, 0]


def test_walls_of_a_large_map_stay():
    cells = np.zeros((5000, 100), np.int8)
    cells[4999, 99] = 100
    cells[:, 50] = 100
    picture = picture_of(cells, Scheme.MAP)
    assert picture.shape == (1667, 34, 3)
    assert (picture[:, 50 // 3] == 0).all()
    assert picture[-1, -1].tolist() == [0, 0, 0]
    assert (picture[:, 0] == 255).all()


def test_a_smaller_map_lies_above_a_larger_and_costs_above_both():
    assert depth_of(3, Scheme.COSTS) < depth_of(20, Scheme.COSTS) < depth_of(20, Scheme.MAP)


def test_a_map_whose_origin_is_no_pose_is_told(scene):
    draw(scene, map=grid(quat=np.zeros(4)), empty=grid(np.zeros((0, 5), np.int8)))
    assert "OccupancyGrid" in scene.problems["/map"]
    assert "/empty" not in scene.problems
    for wrong in (grid(xyz=[np.nan, 0, 0]), grid(resolution=np.nan), grid(resolution=0.0)):
        draw(scene, map=grid())
        assert scene.problems == {}
        draw(scene, map=wrong)
        assert "is not a number" in scene.problems["/map"]


def test_particles_are_arrows_in_one_element(scene, look):
    poses = PoseArray(
        [[1, 2, 0], [5, 5, 5], [0, 0, 1]], [LEFT, np.zeros(4), LEVEL], Header(S, "map")
    )
    draw(scene, particles=poses)
    lines = look("topics/particles/arrows", has("points", 6))["points"]
    lines = lines.reshape(2, 3, 2, 3)
    assert np.allclose(lines[0, 0], [[1, 2, 0], [1, 2.3, 0]], atol=1e-6)
    assert np.allclose(lines[1, 0], [[0, 0, 1], [0.3, 0, 1]], atol=1e-6)
    assert np.allclose(lines[:, 1:, 0], lines[:, :1, 1])
    scene.appearance = Appearance(axes_size=2.0)
    scene.refresh()
    look("topics/particles/arrows", lambda node: node["points"].max() > 2.5)
    draw(scene, particles=PoseArray(np.zeros((0, 3)), np.zeros((0, 4)), Header(2 * S, "map")))
    look("topics/particles/arrows", has("points", 0))


def test_very_many_particles_are_thinned_evenly():
    count = 20_000
    places = np.arange(count)[:, None] * [1.0, 0, 0]
    starts = arrows_of(PoseArray(places, np.tile(LEVEL, (count, 1))), 1.0)[::3, 0, 0]
    assert len(starts) == 5000
    assert (starts[0], starts[-1]) == (0, count - 1)


def test_an_outline_is_closed(scene, look):
    corners = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [np.nan, 0, 0], [0, 1, 0]])
    draw(scene, footprint=PolygonStamped(corners, Header(S, "map")))
    lines = look("topics/footprint/line", has("points", 4))["points"]
    assert lines[-1].tolist() == [[0, 1, 0], [0, 0, 0]]
    assert lines[0].tolist() == [[0, 0, 0], [2, 0, 0]]
    draw(scene, footprint=PolygonStamped(np.zeros((0, 3)), Header(2 * S, "map")))
    look("topics/footprint/line", has("points", 0))


@pytest.mark.parametrize("topic", ["map", "particles", "footprint"])
def test_after_a_jump_nothing_is_to_be_seen_until_it_comes_again(scene, look, topic):
    header = Header(S, "map")
    message = {
        "map": grid(),
        "particles": PoseArray(np.zeros((1, 3)), [LEVEL], header),
        "footprint": PolygonStamped(np.eye(3), header),
    }[topic]
    draw(scene, **{topic: message})
    look(f"topics/{topic}", lambda node: node["visible"])
    scene.forget()
    scene.refresh()
    look(f"topics/{topic}", lambda node: not node["visible"])
    draw(scene, **{topic: message})
    look(f"topics/{topic}", lambda node: node["visible"])
