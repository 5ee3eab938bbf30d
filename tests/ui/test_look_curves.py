"""Numbers over time: of a recording at once, of others as they come."""

import json
from contextlib import contextmanager

import numpy as np
import pytest
from made_videos import numbered, write_video
from scene_messages import odometry
from scene_runtime import Told
from waiting import wait_for

from ros_visualise.data import Image, Odometry
from ros_visualise.geometry.thinning import extremes
from ros_visualise.graph.pipelines import film_pipeline, recording_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.playback import Playback
from ros_visualise.ui.look import Inspector
from ros_visualise.ui.look.answers import BrowserQuery
from ros_visualise.ui.look.curve import Curve

BLOCK = """{n}
00:00:{a:02d},000 --> 00:00:{b:02d},000
HOME(149.0251,-20.2532) 2017.08.05 14:11:51
GPS({x:.4f},-20.2533,16) BAROMETER:1.9

"""
WHOLE = "ask=curves&from=0&to=1e9"


def ask(inspector, query):
    return json.loads(inspector.answer(BrowserQuery(query)).body)


def flight(file, count=40):
    """That many fixes, one a second."""
    blocks = (BLOCK.format(n=n + 1, a=n, b=n + 1, x=149 + n / 1000) for n in range(count))
    file.write_text("".join(blocks))
    return file


@contextmanager
def looking(graph):
    """At a graph that is paused."""
    playback = Playback(hold=True)
    playback.pause()
    runtime = LocalRuntime(graph, playback)
    runtime.start()
    inspector = Inspector(runtime)
    yield inspector
    inspector.close()
    runtime.stop()


@pytest.fixture
def inspector(tmp_path):
    with looking(recording_pipeline(open_recording(flight(tmp_path / "flight.SRT")))) as inspector:
        yield inspector


def whole_curve(inspector, field):
    """As soon as it is there."""

    def found():
        (curve,) = ask(inspector, f"{WHOLE}&field={field}")["curves"]
        return curve if curve["share"] == 1 else None

    return wait_for(found, "the whole curve")


def test_a_paused_recording_is_there_from_its_start_to_its_end(inspector):
    curve = whole_curve(inspector, "/gps/fix:longitude")
    assert curve["times"] == list(range(40))
    assert np.allclose(curve["values"], 149 + np.arange(40) / 1000)
    (part,) = ask(inspector, "ask=curves&from=10&to=12&field=/gps/fix:longitude")["curves"]
    assert part["times"] == [9, 10, 11, 12, 13]  # and one of either side
    assert "longitude" in ask(inspector, "ask=fields&topic=/gps/fix")["fields"]


def test_what_was_measured_beside_a_film_is_there_whole(tmp_path):
    film = write_video(tmp_path / "film.mkv", numbered(3))
    flight(film.with_suffix(".SRT"), 9)
    with looking(film_pipeline(film)) as inspector:
        curve = whole_curve(inspector, "/fix:longitude")
        assert "longitude" in ask(inspector, "ask=fields&topic=/fix")["fields"]
    assert curve["times"] == list(range(9))
    assert np.allclose(curve["values"], 149 + np.arange(9) / 1000)


def test_a_click_goes_there(inspector):
    assert ask(inspector, "ask=play&seek=17")["playing"] is False
    wait_for(lambda: ask(inspector, WHOLE)["position"] == 17)
    assert inspector.answer(BrowserQuery("ask=play&seek=nan")).status == 400
    assert inspector.answer(BrowserQuery("ask=play&seek=5"), is_viewer=True).status == 403


def test_what_is_live_grows():
    told = Told(odom=Odometry, image=Image)
    inspector = Inspector(told)
    try:
        query = f"{WHOLE}&field=/odom:pose.pose.position.x"
        assert ask(inspector, query)["curves"][0]["times"] == []
        for second in (5, 6, 8):
            told.say(odom=odometry([second, 0, 0], second))
        (curve,) = ask(inspector, query)["curves"]
        assert curve["share"] is None
        assert curve["times"] == [0, 1, 3]
        assert curve["values"] == [5, 6, 8]
        told.say(odom=odometry([9, 0, 0], 9))
        *others, there = ask(inspector, f"{WHOLE}&field=/image:width&field=/gone:x&{query}")[
            "curves"
        ]
        assert all(one["error"] and not one["times"] for one in others)
        assert there["values"][-1] == 9, "one that cannot be drawn takes no other with it"
        assert inspector.answer(BrowserQuery(f"{WHOLE}&field=odom")).status == 400
    finally:
        inspector.close()
    assert told.asked["/odom"] == 0


def test_after_a_jump_back_the_later_part_goes():
    curve = Curve(None)
    for time_s in (0, 1, 2, 3, 1.5):
        curve.add(time_s, 10 * time_s)
    times_s, values = curve.between(0, 9, 100)
    assert times_s.tolist() == [0, 1, 1.5]
    assert values.tolist() == [0, 10, 15]


def test_thinned_curves_keep_each_peak():
    times_s = np.arange(100_000.0)
    values = np.sin(times_s / 500)
    values[[777, 54_321]] = [9, -7]
    values[1234] = np.nan
    chosen = extremes(values, 400)
    kept_s, kept = times_s[chosen], values[chosen]
    assert len(kept) <= 400
    assert (kept.max(), kept.min()) == (9, -7)
    assert kept_s[kept.argmax()] == 777
    assert np.isfinite(kept).all()
    assert (np.diff(kept_s) > 0).all()
