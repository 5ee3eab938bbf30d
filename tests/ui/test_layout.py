"""Which room windows get."""

from types import SimpleNamespace

import pytest

from ros_visualise.ui.page import layout
from ros_visualise.ui.page.worker import Worker


@pytest.fixture
def arranged(monkeypatch):
    """What was asked for: whether there is a scene, and whether images are wide."""
    asked = []
    monkeypatch.setattr(layout, "rearrange", lambda *given: asked.append(given[3:]))
    return asked


@pytest.mark.parametrize(
    ("aspects", "scene", "expected"),
    [
        ([3.3, 3.3], True, [(True, True)]),
        ([3.3, None], True, [(True, True)]),
        ([3.3, 1.3], True, []),
        ([1.3], True, []),
        ([None], True, []),
        ([3.3], False, []),
    ],
)
def test_wide_images_beside_a_scene_get_a_wide_column_once(
    server, arranged, aspects, scene, expected
):
    choice = layout.Choice(
        server.gui, server.gui.add_folder("windows"), Worker(print, lambda: None, 1.0)
    )
    windows = [
        SimpleNamespace(
            name=str(number),
            aside=False,
            shows_anything=True,
            picture=SimpleNamespace(aspect=aspect),
        )
        for number, aspect in enumerate(aspects)
    ]
    choice.follow(windows, scene)
    choice.refresh()
    choice.refresh()
    assert arranged == expected
