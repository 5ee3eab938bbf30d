"""``--start`` and ``--duration`` in a view that stays: the playback range of what has an end."""

import signal
import subprocess
import sys

import forked
import pytest
from made_videos import numbered, write_video
from page_client import TOKEN, ClockClient

from ros_visualise.graph.pipelines import image_pipeline, simulation_pipeline
from ros_visualise.running.options import PlayingOptions
from ros_visualise.running.play import _playback

OPTIONS = PlayingOptions(start=0.1, duration=0.2)


@pytest.mark.parametrize(
    ("graph", "stays", "part_s"),
    [
        (image_pipeline("streamer"), True, (0.1, pytest.approx(0.3))),
        (image_pipeline("streamer"), False, (0.0, None)),
        (image_pipeline("camera"), True, (0.0, None)),
        (simulation_pipeline("husky"), True, (0.0, None)),
    ],
    ids=["film", "film without a view", "camera", "simulation"],
)
def test_the_range_is_that_of_a_film_in_a_view(graph, stays, part_s):
    playback = _playback(OPTIONS, graph, stays)
    assert playback.state.part_s == part_s
    assert playback.holds is (part_s != (0.0, None))


def test_the_page_stays_at_the_end_of_the_range_and_loops_it(tmp_path, port):
    film = write_video(tmp_path / "film.mkv", numbered(25))
    options = ["--start", "0.2", "--duration", "0.2", "--port", str(port), "--no-open"]
    command = [sys.executable, "-m", "ros_visualise", "video", str(film), *options]
    with forked.Forked(command, text=True, stderr=subprocess.PIPE) as process:
        assert any("open http" in line for line in process.stderr)
        with ClockClient(port, TOKEN) as clock:
            ended = clock.read_until(lambda state: state["ended"])
            assert ended["part"] == [0.2, pytest.approx(0.4)]
            assert ended["position"] == pytest.approx(0.4)
            clock.act(loop=True)
            assert 0.2 <= clock.read_until(lambda state: not state["ended"])["position"] <= 0.4
            clock.act(whole=True)
            clock.read_until(lambda state: state["position"] > 0.4)
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 130
