"""The landscape node: the program's own scene as messages."""

import numpy as np

from ros_visualise.nodes.landscape import Landscape, LandscapeParams
from ros_visualise.sources.flyover import Flyover
from ros_visualise.sources.playback import Playback


def test_it_plays_the_flyover() -> None:
    landscape = Landscape(LandscapeParams(size="64x48"), Playback(rate=0, start_s=2, frames=3))
    messages = list(landscape.messages())
    landscape.close()
    assert [name for name, _ in messages] == ["image"] * 3
    assert [m.header.stamp_ns for _, m in messages] == [2 * 10**9, 2033333334, 2066666667]
    assert {m.header.frame_id for _, m in messages} == {"camera_optical"}
    assert np.array_equal(messages[0][1].pixels, Flyover((64, 48)).render(2.0))


def test_it_loops_without_an_end() -> None:
    landscape = Landscape(LandscapeParams(size="8x6"), Playback(rate=0, loop=True, frames=2000))
    stamps = [m.header.stamp_ns for _, m in landscape.messages()]
    assert len(stamps) == 2000
    assert np.abs(np.diff(stamps) - 10**9 / 30).max() <= 1
