"""Controls of V4L2 devices, against a kernel made for the tests; no device was at hand."""

import fcntl
from enum import Enum

import pytest
from v4l2_kernel import (
    APERTURE_PRIORITY,
    AUTO,
    BRIGHTNESS,
    EXPOSURE,
    FOCUS,
    FOCUS_AUTO,
    LINK,
    MANUAL,
    WHITE_BALANCE,
    Kernel,
)

from ros_visualise.core.errors import ParameterError
from ros_visualise.sources.v4l2_controls import control_params, set_controls

DEVICE = "/dev/null"


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch) -> Kernel:
    made = Kernel()
    monkeypatch.setattr(fcntl, "ioctl", made.ioctl)
    return made


def test_a_control_is_a_parameter_with_the_value_that_it_has(kernel: Kernel) -> None:
    found = {name: (kind, field) for name, kind, field in control_params(DEVICE)}
    assert list(found) == [
        *("brightness", "white_balance_automatic", "auto_exposure", "exposure_time_absolute"),
        *("focus_absolute", "focus_automatic_continuous", "link_frequency"),
    ]
    kind, brightness = found["brightness"]
    assert (kind, brightness.default) == (int, 5)
    assert (brightness.metadata["min"], brightness.metadata["max"]) == (-64, 64)
    assert not brightness.metadata["restart"]
    kind, white_balance = found["white_balance_automatic"]
    assert (kind, white_balance.default) == (bool, True)
    assert kernel.set == []


def test_a_menu_is_a_choice_of_its_entries(kernel: Kernel) -> None:
    found = {name: (kind, field) for name, kind, field in control_params(DEVICE)}
    kind, exposure = found["auto_exposure"]
    assert issubclass(kind, Enum)
    assert [one.value for one in kind] == ["manual_mode", "aperture_priority_mode"]
    assert exposure.default.value == "aperture_priority_mode"
    kind, _ = found["link_frequency"]
    assert [one.value for one in kind] == ["450000000", "900000000"]
    set_controls(DEVICE, {"auto_exposure": "manual_mode", "link_frequency": "900000000"})
    assert kernel.set == [(AUTO, MANUAL), (LINK, 1)]


def test_what_decides_on_a_number_is_set_before_it(kernel: Kernel) -> None:
    wanted = {"focus_absolute": 7, "exposure_time_absolute": 200, "auto_exposure": "manual_mode"}
    set_controls(DEVICE, {"brightness": -10, **wanted, "focus_automatic_continuous": False})
    assert sorted(kernel.set[:2]) == [(AUTO, MANUAL), (FOCUS_AUTO, 0)]
    assert kernel.set[2:] == [(BRIGHTNESS, -10), (FOCUS, 7), (EXPOSURE, 200)]


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("exposure_time_absolute", 9, "=9: Permission denied; first switch off the automatic mode"),
        ("gamma", 3, "/dev/null: no control 'gamma'"),
        ("reset", 1, "no control 'reset'"),
        ("privacy", True, "no control 'privacy'"),
        ("auto_exposure", "auto", "auto_exposure=auto: choose one of manual_mode, aperture_pri"),
    ],
)
def test_what_the_device_does_not_take_is_told_and_the_rest_is_set(
    kernel: Kernel, name: str, value: int | str, expected: str
) -> None:
    with pytest.raises(ParameterError, match=expected):
        set_controls(DEVICE, {name: value, "white_balance_automatic": False})
    assert kernel.set == [(WHITE_BALANCE, 0)]
    assert kernel.values[AUTO] == APERTURE_PRIORITY


def test_what_has_no_controls_has_no_parameters() -> None:
    assert control_params("/dev/null") == control_params("/dev/none") == []
    set_controls("/dev/none", {})
    with pytest.raises(ParameterError, match=r"/dev/none: No such file.*; its controls cannot be"):
        set_controls("/dev/none", {"brightness": 1})
    with pytest.raises(ParameterError, match="/dev/null: no control 'brightness'"):
        set_controls("/dev/null", {"brightness": 1})
