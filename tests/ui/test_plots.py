"""Plots as browsers get them: of a recording at once, of others as messages come."""

from contextlib import contextmanager

import numpy as np
import pytest
from hub_client import HubClient
from made_videos import numbered, write_video
from scene_messages import odometry
from scene_runtime import Told
from waiting import wait_for

from ros_visualise.data import Image, Odometry
from ros_visualise.graph.pipelines import film_pipeline, recording_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.playback import Playback
from ros_visualise.ui.live.curve_set import BadCurve, CurveSet
from ros_visualise.ui.live.curves import SampleStore
from ros_visualise.ui.live.plots import PlotHub
from ros_visualise.ui.live.sampling import LiveCurves
from ros_visualise.ui.server.host import page_loop

BLOCK = """{n}
00:00:{a:02d},000 --> 00:00:{b:02d},000
HOME(149.0251,-20.2532) 2017.08.05 14:11:51
GPS({x:.4f},-20.2533,16) BAROMETER:1.9

"""
LONGITUDE, X = "/gps/fix:longitude", "/odom:pose.pose.position.x"


def flight(file, count=40):
    """That many fixes, one a second."""
    blocks = (BLOCK.format(n=n + 1, a=n, b=n + 1, x=149 + n / 1000) for n in range(count))
    file.write_text("".join(blocks))
    return file


@contextmanager
def plotting(runtime):
    """A browser of a page that shows this runtime."""
    hub = PlotHub(page_loop())
    hub.show(runtime)
    try:
        with HubClient(hub, is_viewer=True) as client:
            yield client
    finally:
        hub.close()


@contextmanager
def paused(graph):
    playback = Playback(hold=True)
    playback.pause()
    runtime = LocalRuntime(graph, playback)
    runtime.start()
    with plotting(runtime) as client:
        yield client
    runtime.stop()


@pytest.fixture
def client(tmp_path):
    with paused(recording_pipeline(open_recording(flight(tmp_path / "flight.SRT")))) as client:
        yield client


@pytest.fixture
def told():
    return Told(odom=Odometry, truth=Odometry, image=Image)


@pytest.fixture
def live(told):
    with plotting(told) as client:
        yield client


def show(client, *views, **more):
    """What is sent of these views, as soon as it is whole."""
    views = [{"curve": one} if isinstance(one, str) else one for one in views]
    show.number = getattr(show, "number", 0) + 1
    client.send({"number": show.number, "views": views, "columns": 500, **more})
    found = {}

    def take(message):
        if message.get("number") == show.number:
            found[message["view"]] = message
        return len(found) == len(views) and all(
            one["error"] or one["share"] in (1, None) for one in found.values()
        )

    client.read_until(take)
    return [(found[number], found[number]["rows"]) for number in range(len(views))]


def grown(client, count):
    """The first curve as soon as it has so many samples."""
    return client.read_until(lambda one: len(one.get("rows", ())) >= count)["rows"].T.tolist()


def test_a_paused_recording_is_there_from_its_start_to_its_end(client):
    ((header, rows),) = show(client, LONGITUDE)
    assert rows[:, 0].tolist() == list(range(40))
    assert np.allclose(rows[:, 1], 149 + np.arange(40) / 1000)
    assert (header["span"], header["unit"]) == ([0, 39], "°")
    ((_, part),) = show(client, LONGITUDE, **{"from": 10, "to": 12})
    assert part[:, 0].tolist() == [9, 10, 11, 12, 13], "with one on either side"


def test_topics_and_fields_are_offered_with_their_units(client):
    topics = client.read_until(lambda one: "topics" in one)["topics"]
    assert topics["/gps/fix"] == "sensor_msgs/msg/NavSatFix"
    client.send(fields="/gps/fix")
    found = client.read_until(lambda one: "fields" in one)
    assert dict(zip(found["paths"], found["units"], strict=True))["longitude"] == "°"
    client.send(fields="/no")
    assert "no such topic" in client.read_until(lambda one: "fields" in one)["error"]


def test_what_was_measured_beside_a_film_is_there_whole(tmp_path):
    film = write_video(tmp_path / "film.mkv", numbered(3))
    flight(film.with_suffix(".SRT"), 9)
    with paused(film_pipeline(film)) as client:
        ((_, rows),) = show(client, "/fix:longitude")
    assert rows[:, 0].tolist() == list(range(9))
    assert np.allclose(rows[:, 1], 149 + np.arange(9) / 1000)


def test_what_is_live_grows_and_one_that_is_unknown_takes_no_other_with_it(told, live):
    found = show(live, "/gone:x", "odom", X, "/image:width", '="/odom:x" +', "")
    assert [bool(header["error"]) for header, _ in found] == [True, True, False, False, True, True]
    assert not any(len(rows) for _, rows in found)
    for second in (5, 6, 8):
        told.say(odom=odometry([second, 0, 0], second))
    assert grown(live, 3) == [[0, 1, 3], [5, 6, 8]]
    told.say(image=Image(np.zeros((2, 7), np.uint8), "mono8"))
    width = live.read_until(lambda one: one.get("view") == 3)
    assert width["rows"][:, 1].tolist() == [7], "every number of every message"


def test_what_does_not_change_is_sent_once(told, live):
    show(live, X, "/truth:pose.pose.position.x", f'="{X}" * 2')
    told.say(truth=odometry([5, 0, 0], 6))
    assert live.read_until(lambda one: "rows" in one)["view"] == 1
    for _ in range(3):
        live.send(fields="/no")
        assert "fields" in live.read(), "and nothing else"


def test_values_are_whole_doubles(told, live):
    longitude = 149.1234567890123
    show(live, X, f'="{X}"*3', f'=derivative("{X}")')
    told.say(odom=odometry([0, 0, 0], 1))
    told.say(odom=odometry([longitude, 0, 0], 4))
    found = {}
    while any(len(found.get(number, ())) < 2 for number in range(3)):
        news = live.read_until(lambda one: "rows" in one)
        found[news["view"]] = news["rows"]
    assert [rows[1, 1] for _, rows in sorted(found.items())] == [
        longitude,
        longitude * 3,
        longitude / 3,
    ]


def test_late_messages_are_put_in_their_places(told, live):
    show(live, X)
    for second in (5, 8, 6, 9, 7):
        told.say(odom=odometry([second, 0, 0], second))
    assert grown(live, 5) == [[0, 1, 2, 3, 4], [5, 6, 7, 8, 9]]


def test_after_a_jump_back_the_later_part_goes(told):
    live, store = LiveCurves(told), SampleStore(["pose.pose.position.x"])
    live.add("/odom", store)
    for second in (5, 6, 7, 8):
        told.say(odom=odometry([second, 0, 0], second))
    told.epoch = 1
    told.say(odom=odometry([60, 0, 0], 6.5))
    live.take()
    times_s, values = store.whole("pose.pose.position.x")
    assert times_s.tolist() == [0, 1, 1, 1.5]
    np.testing.assert_equal(values, [5, 6, np.nan, 60])


def test_curves_outlive_the_browser_that_asked_for_them(told, clock, monkeypatch):
    curves = CurveSet(told)
    monkeypatch.setattr(curves.live, "_clock", clock)
    curves.begin([X])
    for second in range(5):
        told.say(odom=odometry([second, 0, 0], second))
        clock.now_s += 100
        curves.rest()
    clock.now_s += 500
    curves.rest()
    assert told.asked["/odom"] == 0, "nobody has asked for ten minutes"
    told.say(odom=odometry([5, 0, 0], 5))
    curves.begin([X])
    told.say(odom=odometry([9, 0, 0], 9))
    curves.rest()
    values = curves.curve(X).samples().values
    curves.close()
    np.testing.assert_equal(values, [0, 1, 2, 3, 4, np.nan, 5, 9])  # 5: the last one then


def test_a_page_that_goes_unsubscribes(told, live):
    show(live, X)
    assert told.asked["/odom"] == 1
    with plotting(told) as other:
        show(other, X)
        assert told.asked["/odom"] == 2
    wait_for(lambda: told.asked["/odom"] == 1)


def test_derived_curves_of_a_recording(client):
    expected = {
        f'derivative("{LONGITUDE}")': ([np.nan, *[0.001] * 39], "°/s"),
        f'("{LONGITUDE}" - 149) * 1000': (list(range(40)), ""),
        'mean("/gps/fix:latitude", 5)': ([-20.2533] * 40, "°"),
    }
    for (values, unit), (header, rows) in zip(
        expected.values(), show(client, *(f"={text}" for text in expected)), strict=True
    ):
        assert (header["error"], header["unit"]) == ("", unit)
        assert np.allclose(rows[:, 1], values, equal_nan=True)
    for text in ('__import__("os")', '"/no:x"', "1 + 1", f'"{LONGITUDE}" +'):
        ((header, rows),) = show(client, f"={text}")
        assert header["error"]
        assert not len(rows)


def test_one_curve_against_another(client):
    ((header, rows),) = show(client, {"x": LONGITUDE, "y": f'="{LONGITUDE}" * 2'})
    assert rows.shape == (40, 3)
    assert np.allclose(rows[:, 1], 2 * rows[:, 0])
    assert rows[:, 2].tolist() == list(range(40))
    assert header["units"] == ["°", ""]


def test_statistics_of_a_topic(client):
    gaps, rate, values = show(
        client, {"intervals": "/gps/fix"}, {"rates": "/gps/fix"}, {"histogram": LONGITUDE}
    )
    assert gaps[0]["summary"]["median"] == 1
    assert gaps[0]["summary"]["count"] == gaps[1][:, 2].sum() == 39
    assert np.allclose(rate[1][:, 1], 1, atol=0.1)
    assert values[0]["summary"]["max"] == pytest.approx(149.039)
    assert values[1][:, 2].sum() == 40


def test_statistics_of_damaged_numbers(told, live):
    views = [{kind: X} for kind in ("histogram", "spectrum", "curve")] + [{"intervals": "/odom"}]
    show(live, *views)
    for second, value in enumerate([1, np.nan, np.inf, 1e308, -1e308, 3, 5e-324]):
        told.say(odom=odometry([value, 0, 0], second))
    while (one := live.read_until(lambda one: one.get("view") == 0))["summary"]["count"] < 3:
        pass
    assert one["summary"]["max"] == 3
    ((_, rows),) = show(live, X)
    assert rows[3:5, 1].tolist() == [1e308, -1e308]


def test_values_at_the_cursor_are_the_last_until_then(client):
    show(client, LONGITUDE)
    client.send({"at": 7.9, "curves": [LONGITUDE, "/no:x", f'="{LONGITUDE}" - 149']})
    found = client.read_until(lambda one: "values" in one)
    assert found["values"] == [pytest.approx(149.007), None, pytest.approx(0.007)]


def test_a_table_has_a_row_for_each_stamp(client):
    client.send({"csv": [LONGITUDE, '=derivative("/gps/fix:longitude")', "/no:x"], "to": 2.5})
    text = ""
    while piece := client.read_until(lambda one: "csv" in one)["csv"]:
        text += piece
    head, first, second, _ = text.splitlines()
    assert head == 'time,stamp,"/gps/fix:longitude","=derivative(""/gps/fix:longitude"")"'
    assert first.split(",")[::2] == ["0.000000000", "149.0"]
    assert first.endswith(",nan")
    stamps = [float(line.split(",")[1]) for line in (first, second)]
    assert stamps[1] - stamps[0] == 1
    assert stamps[0] > 1.4e9, "an epoch"


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


def test_what_was_not_requested_lately_makes_room(told):
    curves = CurveSet(told, max_bytes=30_000)
    x, y = (f"{topic}:pose.pose.position.x" for topic in ("/odom", "/truth"))

    def values(text):
        curves.begin([text])
        curves.live.take()
        return curves.curve(text).samples().values.tolist()

    values(x)
    told.say(odom=odometry([7, 0, 0], 7))
    assert values(x) == [7]
    assert values(f'="{x}" * 2') == [14]
    values(y)
    assert (told.asked["/odom"], told.asked["/truth"]) == (0, 1)
    for factor in range(9):
        assert values(f'="{y}" * {factor}') == []
    assert told.asked["/truth"] == 1
    with pytest.raises(BadCurve, match="remove some"):
        values(f'="{x}" + "{y}"')
    curves.close()


@pytest.mark.parametrize(
    "text",
    [
        *("", "x", "[]", "1", "null", "[" * 50_000, '{"views": 1}', '{"fields": 5}', "\x00"),
        *('{"views": [1, null, {}, {"curve": 1}, {"x": "a"}, {"x": 1, "curve": "/odom:"}]}',),
        '{"views": [{"x": "/odom:", "y": "/odom:", "spectrum": "a"}], "columns": 1e99}',
        '{"views": [], "from": NaN, "to": Infinity, "last": -1, "columns": true}',
        '{"views": [{"curve": "/odom:"}], "number": '
        + "9" * 4000
        + ', "last": 1'
        + "0" * 400
        + "}",
        '{"views": [{"spectrum": "/odom:"}, {"histogram": "\\ud800:"}, {"rates": "/odom"}]}',
        *('{"at": "x", "curves": ["a"]}', '{"csv": {}}', '{"csv": [["a"]]}', '{"at": 1}'),
        '{"csv": ["\\ud800", "="], "from": "a"}',
    ],
)
def test_nonsense_ends_nothing(told, live, text):
    live.send(text)
    told.say(odom=odometry([5, 0, 0], 5))
    ((header, _),) = show(live, X)
    assert header["error"] == ""
