"""What is drawn beside films, and where frames have names."""

from ros_visualise.data import Image, Imu, NavSatFix, Path, PointCloud, Transforms
from ros_visualise.ui.scene.kinds import is_track, is_tree


def test_a_scene_of_tracks_alone_leaves_room_to_films():
    assert is_track({"/image": Image, "/fix": NavSatFix, "/path": Path, "/imu": Imu})
    assert not is_track({"/image": Image, "/fix": NavSatFix, "/points": PointCloud})
    assert not is_track({"/tf": Transforms, "/path": Path})


def test_frames_have_names_where_nothing_else_is_drawn():
    assert is_tree({"/tf": Transforms, "/tf_static": Transforms})
    assert not is_tree({"/tf": Transforms, "/path": Path})
    assert not is_tree({})
