"""Declarations made for parameters that are known only at run time."""

import pytest

from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import specs, update
from ros_visualise.runtime.remote.declaration import (
    ParameterDescription,
    declared,
    name_here,
    name_there,
)

TOLD = [
    ParameterDescription("gain", float, 0.5, "of the amplifier", 0.0, 2.0, group="audio"),
    ParameterDescription("lambda", int, 3),
    ParameterDescription("on", bool, True),
    ParameterDescription("mode", int, 7, choices={"slow": 7, "quick": 9}),
    ParameterDescription("level", int, 1, choices={"low": 2, "high": 3}),
]


def test_each_parameter_is_a_field_with_what_was_told_of_it():
    params = declared(TOLD)
    gain, lambda_, on, mode, level = specs(params)
    assert (gain.name, gain.type, gain.default, gain.help) == ("gain", float, 0.5, TOLD[0].help)
    assert (gain.min, gain.max, gain.group) == (0, 2, "audio")
    assert (lambda_.name, lambda_.default, on.default) == ("lambda_", 3, True)
    assert list(mode.choices) == ["slow", "quick"]
    assert params().mode.value == "slow"
    assert (level.default, list(level.choices)) == (1, [])  # none of its choices is its value
    assert update(params(), {"mode": "quick", "gain": 2}).mode.value == "quick"
    with pytest.raises(ParameterError, match="0"):
        update(params(), {"gain": 3.0})
    with pytest.raises(ParameterError, match="slow, quick"):
        update(params(), {"mode": "9"})


def test_what_is_called_or_written_otherwise_here_is_not_saved():
    saved = {spec.name: spec.saved for spec in specs(declared(TOLD))}
    assert saved == {"gain": True, "lambda_": False, "on": True, "mode": False, "level": False}


@pytest.mark.parametrize(
    "name", ["gain", "lambda", "class", "gain_", "__class__", "__init__", "___"]
)
def test_names_come_back(name):
    assert name_here(name).isidentifier()
    assert name_there(name_here(name)) == name


@pytest.mark.parametrize("name", ["__class__", "__init__", "__dict__", "__eq__", "__slots__"])
def test_a_name_that_python_uses_is_a_parameter_like_any_other(name):
    params = declared([ParameterDescription(name, int, 3)])()
    assert [getattr(params, spec.name) for spec in specs(type(params))] == [3]
    assert vars(update(params, {name_here(name): 4})) == {name_here(name): 4}
