"""What launch files and command lines give to parameters."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import pytest

from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import param
from ros_visualise.runtime.bridge.parameter_values import given_values


class Blur(Enum):
    OFF = "off"
    GAUSSIAN = "gaussian"


class Answer(Enum):
    NO = "n"
    YES = "y"


@dataclass(frozen=True)
class Params:
    blur: Blur = param(Blur.GAUSSIAN, "blur")
    answer: Answer = param(Answer.NO, "answer")
    scale: float = param(1.0, "scale", min=0, max=4)


def test_choices_are_known_by_what_yaml_makes_of_them() -> None:
    given = {"blur": False, "answer": True, "scale": 2}
    assert given_values(Params, given, (), "") == {
        "blur": Blur.OFF,
        "answer": Answer.YES,
        "scale": 2.0,
    }


def test_what_is_unknown_is_said_in_one_line(caplog: pytest.LogCaptureFixture) -> None:
    foreign = {f"other_{number}": number for number in range(50)}
    assert given_values(Params, {**foreign, "scale": 3, "port": 1}, ("port",), "own.")
    [said] = caplog.messages
    assert said.startswith("ignored unknown parameters: own.other_0, ")
    assert "and 45 more; known: blur, answer, scale, port" in said


@pytest.mark.parametrize("value", [[1], {"a": 1}, (1, 2), None])
def test_what_is_no_single_value_is_refused(value: object) -> None:
    with pytest.raises(ParameterError, match="must be a single value"):
        given_values(Params, {"scale": value}, (), "")
