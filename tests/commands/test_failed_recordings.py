"""A recording that cannot go on fails alone: others go on, and the exit status is 1."""

from made_videos import numbered, write_video

from ros_visualise.sources.opening import open_recording

COUNT = 40
WIDE = """
import numpy as np
from ros_visualise.data import Image
from ros_visualise.nodes import node

@node("wide", inputs={"image": Image}, outputs={"image": Image})
def wide(image, params):
    return Image(np.zeros((2, 20000), np.uint8), "mono8", image.header)
"""
"""Images that no H.264 encoder takes."""


def test_another_recording_goes_on(run, tmp_path):
    film = write_video(tmp_path / "v.mkv", numbered(COUNT))
    (tmp_path / "own.py").write_text(WIDE)
    failing, going = f"{tmp_path}/v.mp4@/wide", f"{tmp_path}/r.mcap@/image_raw"
    quick = ("--view", "none", "--rate", "0", "--node", f"{tmp_path}/own.py:wide")
    status, said = run("video", film, *quick, "--record", failing, "--record", going)
    assert status == 1
    assert f"{going.partition('@')[0]}: {COUNT} messages recorded" in said
    recording = open_recording(tmp_path / "r.mcap")
    assert recording.topics["/image_raw"].messages == COUNT
    recording.close()
