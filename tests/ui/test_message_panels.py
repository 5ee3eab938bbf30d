"""Messages, log, diagnostics and statistics in a browser."""

import json
import logging

import pytest
from page_client import wait_in
from test_plot_panel import X, Y, recorded, runtime  # noqa: F401

BESIDE = {"row": [{"panel": "messages", "state": {"topic": "/odom"}}, {"panel": "plots"}]}


@pytest.fixture
def panels(browse):
    """A page with these panels."""

    def open_panels(layout):
        text = json.dumps(layout, separators=(",", ":")).translate(str.maketrans('"~', '~"'))
        return browse(f"?layout={text}", images=False)

    return open_panels


def test_fields_are_read_folded_and_dragged_to_a_plot(panels, runtime):  # noqa: F811
    runtime.playback.seek(1.0)
    tab = panels(BESIDE)
    tree = tab.get_by_role("tree", name="Message of /odom")
    y = tree.get_by_role("treeitem").filter(has_text="12.3456789012").first
    y.wait_for(timeout=60_000)
    assert "… of 36" in tree.inner_text()
    assert tree.get_by_text("[35]").count() == 0
    tree.get_by_role("button", name="covariance").first.click()
    tree.get_by_text("[35]").first.wait_for()
    y.drag_to(tab.locator(".rv-chart"))
    curve = tab.locator(".rv-curve", has_text=Y)
    wait_in(tab, lambda: curve.count() == 1 and curve.locator("b").inner_text())
    tab.get_by_role("button", name="Table").click()
    wait_in(tab, lambda: tab.get_by_role("columnheader").filter(has_text=".y").count() >= 1)


def test_the_log_is_filtered_by_level_and_words(panels):
    log = logging.getLogger("ros_visualise.test")
    log.warning("the camera <b>0</b> is gone")
    log.error("the disk is full")
    tab = panels({"panel": "log"})
    lines = tab.get_by_role("log", name="Log")
    lines.get_by_text("the camera <b>0</b> is gone").wait_for(timeout=60_000)
    tab.get_by_label("Level").select_option("ERROR")
    wait_in(tab, lambda: "camera" not in lines.inner_text())
    assert "the disk is full" in lines.inner_text()
    tab.get_by_label("Level").select_option("INFO")
    tab.locator(".rv-log").get_by_label("Search").fill("CAMERA")
    wait_in(tab, lambda: "disk" not in lines.inner_text())


def test_diagnostics_and_statistics(panels):
    tab = panels(
        {
            "row": [
                {"panel": "diagnostics"},
                {"panel": "statistics", "state": {"topic": "/odom", "field": X.split(":")[1]}},
            ]
        }
    )
    tab.get_by_text("player").first.wait_for(timeout=60_000)
    tab.get_by_text("Median 0.01").wait_for(timeout=60_000)
    tab.get_by_text("Count 2001").wait_for()
    assert tab.locator(".rv-statistics canvas").count() == 3
