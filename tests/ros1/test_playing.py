"""A playback and the parameters that stand for it on a ROS graph."""

from dataclasses import dataclass

from ros_visualise.core.params import Parameters, param, specs
from ros_visualise.nodes import SourceType
from ros_visualise.runtime.playing import PlaybackFollower, PlayingParams, playing_params
from ros_visualise.sources.playback import Playback


@dataclass(frozen=True)
class FileParams:
    path: str = param("", "the file", restart=True)


def declared(live: bool) -> SourceType:
    return SourceType("file", lambda *_: None, FileParams, {}, live)


def test_a_source_is_declared_with_its_playback():
    names = [spec.name for spec in specs(playing_params(declared(live=False)))]
    assert names == ["path", "paused", "rate", "loop"]


def test_a_live_source_can_be_held_but_has_no_speed():
    params = playing_params(declared(live=True))
    assert [spec.name for spec in specs(params)] == ["path", "paused"]
    playback, parameters = Playback(), Parameters(params())
    follower = PlaybackFollower(playback, parameters)
    parameters.update({"paused": True})
    assert not playback.state.playing
    playback.play()
    follower.follow()
    assert not parameters.current.paused


def test_parameters_drive_the_playback():
    playback, parameters = Playback(), Parameters(PlayingParams())
    PlaybackFollower(playback, parameters)
    parameters.update({"rate": 2.5, "loop": True, "paused": True})
    assert playback.state[2:6] == (False, False, 2.5, True)
    parameters.update({"paused": False})
    assert playback.state.playing


def test_parameters_follow_the_playback():
    playback, parameters = Playback(), Parameters(PlayingParams())
    follower = PlaybackFollower(playback, parameters)
    playback.pause()
    playback.set_rate(0.5)
    follower.follow()
    assert parameters.current == PlayingParams(rate=0.5, paused=True)


def test_what_was_changed_on_the_graph_is_not_undone_by_following():
    playback, parameters = Playback(), Parameters(PlayingParams())
    follower = PlaybackFollower(playback, parameters)
    parameters.update({"paused": True})
    follower.follow()
    assert parameters.current.paused
    assert not playback.state.playing


def test_what_keys_moved_is_not_lost_by_a_change_on_the_graph_before_it_was_seen():
    playback, parameters = Playback(), Parameters(PlayingParams())
    follower = PlaybackFollower(playback, parameters)
    playback.pause()
    playback.set_rate(3.0)
    parameters.update({"loop": True})
    assert (playback.state.playing, playback.state.rate, playback.state.loop) == (False, 3.0, True)
    follower.follow()
    assert parameters.current == PlayingParams(rate=3.0, loop=True, paused=True)
    parameters.update({"paused": False})
    assert playback.state.playing


def test_it_can_start_paused():
    playback = Playback()
    PlaybackFollower(playback, Parameters(PlayingParams(paused=True)))
    assert not playback.state.playing
