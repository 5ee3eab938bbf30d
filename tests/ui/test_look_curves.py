"""Numbers over time: of a recording at once, of others as they come."""

import json
from contextlib import contextmanager
from urllib.parse import quote

import numpy as np
import pytest
from made_videos import numbered, write_video
from scene_messages import odometry
from scene_runtime import Told
from waiting import wait_for

from ros_visualise.data import Image, Odometry
from ros_visualise.graph.pipelines import film_pipeline, recording_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.playback import Playback
from ros_visualise.ui.live.curves import SampleStore
from ros_visualise.ui.look import Inspector
from ros_visualise.ui.look.answers import BrowserQuery
from ros_visualise.ui.look.curve import LiveCurves
from ros_visualise.ui.look.curves import Curves

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


def test_values_are_whole_doubles(tmp_path):
    longitude = 149.1234567890123
    told = Told(odom=Odometry)
    inspector = Inspector(told)
    tripled = quote('="/odom:pose.pose.position.x"*3')
    query = f"{WHOLE}&field=/odom:pose.pose.position.x&field={tripled}"
    ask(inspector, query)
    told.say(odom=odometry([longitude, 0, 0], 1))
    plain, derived = ask(inspector, query)["curves"]
    inspector.close()
    assert plain["values"] == [longitude]
    assert derived["values"] == [longitude * 3]


def test_late_messages_are_put_in_their_places():
    told = Told(odom=Odometry)
    inspector = Inspector(told)
    query = f"{WHOLE}&field=/odom:pose.pose.position.x"
    ask(inspector, query)
    for second in (5, 8, 6, 9, 7):
        told.say(odom=odometry([second, 0, 0], second))
    (curve,) = ask(inspector, query)["curves"]
    inspector.close()
    assert curve["times"] == [0, 1, 2, 3, 4]
    assert curve["values"] == [5, 6, 7, 8, 9]


def test_after_a_jump_back_the_later_part_goes():
    told = Told(odom=Odometry)
    inspector = Inspector(told)
    query = f"{WHOLE}&field=/odom:pose.pose.position.x"
    ask(inspector, query)
    for second in (5, 6, 7, 8):
        told.say(odom=odometry([second, 0, 0], second))
    told.epoch = 1
    told.say(odom=odometry([60, 0, 0], 6.5))
    (curve,) = ask(inspector, query)["curves"]
    inspector.close()
    assert curve["times"] == [0, 1, 1, 1.5]
    assert curve["values"] == [5, 6, None, 60]


def test_curves_outlive_the_page_that_asked_for_them(clock, monkeypatch):
    told = Told(odom=Odometry)
    inspector = Inspector(told)
    monkeypatch.setattr(inspector._curves._live, "_clock", clock)
    query = f"{WHOLE}&field=/odom:pose.pose.position.x"
    ask(inspector, query)
    for second in range(5):
        told.say(odom=odometry([second, 0, 0], second))
        clock.now_s += 100
        inspector.refresh()
    clock.now_s += 500
    inspector.refresh()
    assert told.asked["/odom"] == 0, "nobody has asked for ten minutes"
    told.say(odom=odometry([5, 0, 0], 5))
    ask(inspector, query)
    told.say(odom=odometry([9, 0, 0], 9))
    (curve,) = ask(inspector, query)["curves"]
    inspector.close()
    assert curve["values"] == [0, 1, 2, 3, 4, None, 5, 9]  # 5: the last one when it came back


def test_derived_curves_of_a_recording(inspector):
    whole_curve(inspector, "/gps/fix:longitude")
    for text, expected in {
        'derivative("/gps/fix:longitude")': [None, *[0.001] * 39],
        '("/gps/fix:longitude" - 149) * 1000': list(range(40)),
        'mean("/gps/fix:latitude", 5)': [-20.2533] * 40,
    }.items():
        curve = whole_curve(inspector, quote(f"={text}"))
        assert not curve["error"]
        assert curve["values"][0] == pytest.approx(expected[0])
        assert curve["values"][1:] == pytest.approx(expected[1:])
    for text in ('__import__("os")', '"/no:x"', "1 + 1", '"/gps/fix:longitude" +'):
        (curve,) = ask(inspector, f"{WHOLE}&field={quote('=' + text)}")["curves"]
        assert curve["error"]
        assert not curve["values"]


@pytest.mark.parametrize("is_film", [False, True])
def test_live_curves_lie_at_the_stamps_of_their_messages(tmp_path, is_film):
    film = write_video(tmp_path / "flight.mkv", numbered(9))
    log = flight(film.with_suffix(".SRT"), 9)
    graph = film_pipeline(film) if is_film else recording_pipeline(open_recording(log))
    topic = "/fix" if is_film else "/gps/fix"
    runtime = LocalRuntime(graph, Playback(rate=20, hold=True))
    live, store = LiveCurves(runtime), SampleStore(["longitude"])
    live.add(topic, store)
    runtime.start()
    wait_for(lambda: runtime.playback.state.ended)
    live.take()
    live.rest(all_of_them=True)
    runtime.stop()
    times_s, values = store.whole("longitude")
    assert np.allclose(times_s, np.round(times_s), atol=2e-9), "as they were recorded, one a second"
    assert np.allclose(values, 149 + times_s / 1000)
    assert len(values) == 9


def test_what_was_not_requested_lately_makes_room():
    told = Told(odom=Odometry, truth=Odometry)
    curves = Curves(told, max_bytes=30_000)
    x, y = (f"{topic}:pose.pose.position.x" for topic in ("/odom", "/truth"))

    def values(text):
        answer = curves.curves(BrowserQuery(f"from=0&to=1e9&field={quote(text)}"))
        (curve,) = json.loads(answer.body)["curves"]
        return curve["values"] or curve["error"]

    values(x)
    told.say(odom=odometry([7, 0, 0], 7))
    assert values(x) == [7]
    assert values(f'="{x}" * 2') == [14]
    values(y)
    assert (told.asked["/odom"], told.asked["/truth"]) == (0, 1)
    for factor in range(9):
        assert values(f'="{y}" * {factor}') == ""
    assert told.asked["/truth"] == 1
    assert "remove some" in values(f'="{x}" + "{y}"')
    curves.close()
