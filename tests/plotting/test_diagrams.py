"""Layouts of trees and graphs."""

from ros_visualise.plotting.diagrams import DiagramNode, GraphLayout, tree_rows


def test_a_tree_has_each_name_below_its_parent_and_beside_its_siblings():
    rows = tree_rows({"camera": "base", "laser": "base", "base": "odom", "odom": "map"})
    assert [(row.name, row.depth) for row in rows] == [
        *(("map", 0), ("odom", 1), ("base", 2), ("camera", 3), ("laser", 3)),
    ]
    assert [row.parent for row in rows] == [None, 0, 1, 2, 2]


def test_a_cycle_of_frames_is_shown_once_beside_other_trees():
    rows = tree_rows({"a": "b", "b": "a", "odom": "map"})
    assert sorted(row.name for row in rows) == ["a", "b", "map", "odom"]


def test_a_graph_leads_downwards_and_keeps_its_width():
    nodes = [
        DiagramNode("camera", [], ["/image"]),
        DiagramNode("filter", ["/image", "/in"], ["/out"]),
    ]
    layout = GraphLayout(nodes, width=300, row=30, character=6)
    for above, below in layout.arrows:
        assert layout.places[above].y < layout.places[below].y
    assert (layout.width, layout.height) == (300, 30 * 4)
