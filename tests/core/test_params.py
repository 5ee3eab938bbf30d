from dataclasses import dataclass
from enum import Enum

import pytest

from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import Parameters, param, specs, update


class Mode(Enum):
    OFF = "off"
    FAST = "fast"


class Size(Enum):
    SMALL = 3
    LARGE = 5


@dataclass(frozen=True)
class Example:
    count: int = param(3, "how many", min=0, max=10, slider=(0, 5))
    gain: float = param(0.5, "how much", min=-1, max=1)
    on: bool = param(True, "whether")
    name: str = param("", "what", restart=True)
    mode: Mode = param(Mode.OFF, "how")
    size: Size = param(Size.SMALL, "how large")
    least: int = param(1, "at least", min=1)


def test_specs_say_what_was_declared():
    count, gain, on, name, mode, size, least = specs(Example)
    assert (count.type, count.default, count.help) == (int, 3, "how many")
    assert (count.min, count.max, count.range) == (0, 10, (0, 5))
    assert (gain.range, on.type, name.restart, least.range) == ((-1, 1), bool, True, None)
    assert (mode.choices, size.choices) == (("off", "fast"), ("3", "5"))


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("count", "7", 7),
        ("count", 7.0, 7),
        ("gain", "-0.25", -0.25),
        ("gain", 1, 1.0),
        ("on", "false", False),
        ("on", "On", True),
        ("on", 0, False),
        ("name", "a b", "a b"),
        ("mode", "fast", Mode.FAST),
        ("mode", Mode.FAST, Mode.FAST),
        ("size", "5", Size.LARGE),
        ("size", 5, Size.LARGE),
    ],
)
def test_values_come_as_themselves_or_as_text(name, value, expected):
    result = getattr(update(Example(), {name: value}), name)
    assert result == expected
    assert type(result) is type(expected)


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("count", "11", "count=11: must be from 0 to 10"),
        ("count", "-1", "from 0 to 10"),
        ("count", "2.5", "a whole number from 0 to 10"),
        ("count", "many", "a whole number from 0 to 10"),
        ("count", "1e999", "a whole number"),
        ("gain", "nan", "from -1 to 1"),
        ("least", "0", "at least 1"),
        ("on", "perhaps", "true or false"),
        ("mode", "slow", "one of off, fast"),
        ("count", None, "count: needs a value"),
        ("count", True, "a whole number from 0 to 10"),
        ("nothing", "1", "no parameter 'nothing'; choose from count, gain, on, name, mode"),
    ],
)
def test_refusals_name_what_is_allowed(name, value, says):
    with pytest.raises(ParameterError, match=says):
        update(Example(), {name: value})


def test_an_update_is_applied_as_a_whole_or_not_at_all():
    live = Parameters(Example())
    before = live.current
    with pytest.raises(ParameterError):
        live.update({"count": 1, "gain": 2})
    assert live.current is before
    live.update({"count": 1, "gain": 1})
    assert (live.current.count, live.current.gain, before.count) == (1, 1.0, 3)


def test_listeners_hear_of_real_changes_until_they_leave():
    live = Parameters(Example())
    heard = []
    leave = live.on_change(lambda current, changed: heard.append((current, dict(changed))))
    live.update({"count": "4", "gain": 0.5})
    live.update({"count": 4})
    leave()
    live.update({"count": 5})
    assert [changed for _, changed in heard] == [{"count": 4}]
    assert heard[0][0].count == 4


@dataclass(frozen=True)
class Preset:
    kind: Mode = param(
        Mode.OFF, "which", preset=lambda kind: {"speed": 9 if kind is Mode.FAST else 1, "other": 2}
    )
    speed: int = param(1, "how fast", min=0, max=10)


def test_a_preset_sets_others_but_for_those_that_are_given_with_it():
    fast = update(Preset(), {"kind": "fast"})
    assert (fast.kind, fast.speed) == (Mode.FAST, 9)
    assert update(Preset(), {"speed": 4, "kind": "fast"}).speed == 4
    assert update(fast, {"speed": 3}) == Preset(Mode.FAST, 3)
    assert update(fast, {"kind": "off"}) == Preset()


def test_listeners_hear_what_a_preset_sets():
    live, heard = Parameters(Preset()), []
    live.on_change(lambda current, changed: heard.append(dict(changed)))
    live.update({"kind": "fast"})
    live.update({"kind": "fast", "speed": 3})
    assert heard == [{"kind": Mode.FAST, "speed": 9}, {"speed": 3}]
