"""Which room windows get."""

from types import SimpleNamespace

import pytest

from ros_visualise.data import Image, Imu, NavSatFix, Path, PointCloud, Transforms
from ros_visualise.ui.page import layout
from ros_visualise.ui.page.worker import Worker
from ros_visualise.ui.scene.kinds import is_track, is_tree


@pytest.fixture
def arranged(monkeypatch):
    """What was asked for: whether there is a scene, and whether images are wide."""
    asked = []
    monkeypatch.setattr(
        layout, "rearrange", lambda *given: asked.append((given[3].scene, given[3].wide))
    )
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
    choice = layout.WindowSwitches(
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


def test_a_scene_of_tracks_alone_leaves_room_to_films():
    assert is_track({"/image": Image, "/fix": NavSatFix, "/path": Path, "/imu": Imu})
    assert not is_track({"/image": Image, "/fix": NavSatFix, "/points": PointCloud})
    assert not is_track({"/tf": Transforms, "/path": Path})


def test_frames_have_names_where_nothing_else_is_drawn():
    assert is_tree({"/tf": Transforms, "/tf_static": Transforms})
    assert not is_tree({"/tf": Transforms, "/path": Path})
    assert not is_tree({})
