"""The tree of nodes: what packets say, in which order, and how much there may be."""

import threading

import numpy as np
import pytest
from space_client import Nodes

from ros_visualise.ui.live.space.nodes import ImagePlane, Label, Lines, Points, SpaceNode, solid_row
from ros_visualise.ui.live.space.tree import SpaceFull, SpaceTree


class Browser:
    """It takes packets when it likes to; ``sizes`` are those of all."""

    def __init__(self, tree):
        self.nodes, self.sizes, self._reader = Nodes(), [], tree.reader()

    def read(self):
        packet = self._reader.read()
        if packet is not None:
            self.sizes.append(len(packet))
            self.nodes.take(packet)
        return self.nodes


@pytest.fixture
def browser(tree):
    return Browser(tree)


def test_values_arrive_as_they_were_set(tree, browser):
    tree.add("/a", SpaceNode(position=(1, 2, 3), visible=False))
    points = np.arange(12, dtype=np.float16).reshape(4, 3)
    tree.add("/a/points", Points(points=points, colors=(1, 2, 3), size=0.5))
    tree.add("/a/label", Label(text="\u00e4 </script> \ud800", color=(9, 9, 9)))
    tree.add("/a/picture", ImagePlane(image=b"\x89PNG"))
    nodes = browser.read()
    assert (nodes["/a"]["kind"], nodes["/a"]["visible"]) == ("frame", False)
    assert nodes["/a"]["position"].tolist() == [1, 2, 3]
    found = nodes["/a/points"]
    assert (found["points"].dtype, found["size"], found["colors"]) == (np.float16, 0.5, [1, 2, 3])
    assert np.array_equal(found["points"], points)
    assert nodes["/a/label"]["text"] == "\u00e4 </script> \ud800"
    assert nodes["/a/picture"]["image"] == b"\x89PNG"
    assert nodes.above == {"/a": "", **dict.fromkeys(["/a/points", "/a/label", "/a/picture"], "/a")}


def test_only_what_has_changed_is_sent(tree, browser):
    points = tree.add("/points", Points(points=np.zeros((100_000, 3), np.float32)))
    tree.add("/lines", Lines())
    browser.read()
    points.position = (1, 0, 0)
    assert browser.read()["/points"]["position"].tolist() == [1, 0, 0]
    assert browser.sizes[0] > 1_000_000
    assert browser.sizes[1] < 500
    points.position, points.visible = np.array([1.0, 0, 0]), True
    browser.read()
    assert len(browser.sizes) == 2, "the same values are no news"


def test_a_block_of_changes_is_one_step(tree, browser):
    points = tree.add("/points", Points())
    steps = []
    tree.news = lambda: steps.append(len(browser.read()["/points"]["points"]))
    with tree.atomic():
        points.points = np.zeros((3, 3), np.float32)
        points.colors = np.zeros((3, 3), np.uint8)
        assert not steps
    assert steps == [3]
    assert len(browser.nodes["/points"]["colors"]) == 3


def test_what_is_changed_afterwards_by_the_caller_is_not_sent(tree, browser):
    rows = np.zeros((20, 3), np.float32)
    tree.add("/points", Points(points=rows))
    rows[:] = 7
    assert not browser.read()["/points"]["points"].any()


def test_with_a_parent_its_children_go(tree, browser):
    above = tree.add("/a", SpaceNode())
    inner = tree.add("/a/b", SpaceNode())
    tree.add("/a/b/c", Points())
    tree.add("/ab", SpaceNode())
    browser.read()
    above.remove()
    inner.position = (1, 2, 3)  # is in no tree any more
    assert set(browser.read()) == {"/ab"}
    assert set(Browser(tree).read()) == {"/ab"}
    tree.clear()
    assert not browser.read()


def test_a_node_of_the_same_name_replaces_the_one_before(tree, browser):
    tree.add("/a", Points(size=1.0))
    tree.add("/a/b", Label())
    browser.read()
    tree.add("/a", Label(text="x"))
    assert browser.read()["/a"]["text"] == "x"
    assert set(browser.nodes) == {"/a"}


def test_a_browser_that_missed_a_node_s_whole_life_hears_nothing_of_it(tree, browser):
    browser.read()
    tree.add("/a", Points()).remove()
    browser.read()
    assert not browser.nodes.made


def test_a_browser_that_missed_steps_gets_the_newest_of_each(tree, browser):
    lines = tree.add("/lines", Lines())
    browser.read()
    for number in range(100):
        lines.width = float(number)
        lines.position = (number, 0, 0)
    nodes = browser.read()
    assert (nodes["/lines"]["width"], nodes["/lines"]["position"][0]) == (99, 99)


def test_too_much_is_refused_and_counted():
    tree = SpaceTree(max_bytes=1000, max_nodes=3)
    points = tree.add("/a", Points(points=np.zeros((50, 3), np.float32)))
    with pytest.raises(SpaceFull, match="hide topics"):
        points.points = np.zeros((100, 3), np.float32)
    assert len(points.points) == 50
    with pytest.raises(SpaceFull):
        tree.add("/b", Points(points=np.zeros((50, 3), np.float32)))
    points.points = np.zeros((1, 3), np.float32)
    tree.add("/b", Points(points=np.zeros((50, 3), np.float32)))
    tree.add("/c", SpaceNode())
    with pytest.raises(SpaceFull):
        tree.add("/d", SpaceNode())
    assert tree.refused == 3
    tree.clear()
    assert tree.nbytes == 0


def test_numbers_that_are_none_are_refused_in_single_values(tree):
    with pytest.raises(ValueError, match="finite"):
        Points(size=float("nan"))
    label = tree.add("/a", Label(height=np.float32(0.5)))
    with pytest.raises(ValueError, match="finite"):
        label.height = np.float64("inf")
    assert label.height == 0.5


def test_rows_of_one_solid():
    row = solid_row((1, 2, 3), (255, 0, 51), 0.5)
    assert row.shape == (1, 14)
    assert np.allclose(row[0], [0, 0, 0, 1, 0, 0, 0, 1, 2, 3, 1, 0, 0.2, 0.5])


def test_threads_and_a_browser_work_at_the_same_time(tree, browser):
    def change(number):
        for step in range(200):
            node = tree.add(f"/{number}/{step}", Points(points=np.full((5, 3), step, np.float32)))
            node.position = (step, 0, 0)
            if step % 2:
                node.remove()

    threads = [threading.Thread(target=change, args=(number,)) for number in range(3)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        browser.read()
    nodes = browser.read()
    assert set(nodes) == {f"/{n}/{step}" for n in range(3) for step in range(0, 200, 2)}
    assert all(node["position"][0] == node["points"][0, 0] for node in nodes.values())
