"""The controls of a device as parameters of `camera`: the kernel is made for the tests."""

import fcntl
from collections.abc import Iterator

import pytest
from hub import Hub
from v4l2_kernel import AUTO, BRIGHTNESS, EXPOSURE, MANUAL, Kernel
from waiting import wait_for

from ros_visualise.commands import main
from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import specs
from ros_visualise.graph import Graph
from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources import camera
from ros_visualise.sources.camera import Address, open_live, parse_address
from ros_visualise.sources.playback import Playback

DEVICE = "/dev/null"
PICTURES = parse_address("lavfi:testsrc2=size=64x48:rate=50,realtime")
QUICK = ("--view", "none", "--frames", "3")


class Device(Kernel):
    """A kernel and how often its webcam was opened."""

    opened = 0


@pytest.fixture
def device(monkeypatch: pytest.MonkeyPatch) -> Device:
    made = Device()

    def opened(_: Address, timeout_s: float) -> object:
        made.opened += 1
        return open_live(PICTURES, timeout_s)

    monkeypatch.setattr(fcntl, "ioctl", made.ioctl)
    monkeypatch.setattr(camera, "open_live", opened)
    return made


@pytest.fixture
def runtime(device: Device) -> Iterator[LocalRuntime]:
    made = LocalRuntime(image_pipeline("camera", uri=DEVICE), Playback())
    made.start()
    yield made
    made.stop()


def names(graph: Graph) -> list[str]:
    assert graph.source is not None
    return [spec.name for spec in specs(graph.source.params)]


def test_they_come_with_the_device(device: Device) -> None:
    graph = image_pipeline("camera", uri=DEVICE)
    assert {"brightness", "auto_exposure", "exposure_time_absolute"} <= {*names(graph)}
    assert "brightness" not in names(image_pipeline("camera", uri="test"))
    again = graph.configured({"camera": {"brightness": 3}}).configured({"camera": {"uri": "test"}})
    assert names(again) == names(image_pipeline("camera", uri="test"))


def test_a_change_is_set_at_once_without_opening_the_device_anew(
    runtime: LocalRuntime, device: Device
) -> None:
    assert device.set == []  # it stays as it was found
    parameters = runtime.parameters["camera"]
    parameters.update({"brightness": -10})
    parameters.update({"exposure_time_absolute": 200, "auto_exposure": "manual_mode"})
    assert device.set == [(BRIGHTNESS, -10), (AUTO, MANUAL), (EXPOSURE, 200)]
    wait_for(lambda: runtime.report().nodes["camera"].received > 3, "images")
    assert device.opened == 1


def test_a_refused_change_does_not_hold(runtime: LocalRuntime, device: Device) -> None:
    parameters = runtime.parameters["camera"]
    before, told = parameters.current, list[object]()
    parameters.on_change(lambda *args: told.append(args))
    with pytest.raises(
        ParameterError, match="exposure_time_absolute=200: Permission denied; first switch off"
    ):
        parameters.update({"exposure_time_absolute": 200, "brightness": 9})
    assert parameters.current == before
    assert told == []
    assert device.values[BRIGHTNESS] == before.brightness == 5
    device.gone = True
    with pytest.raises(ParameterError, match="/dev/null: No such device; its controls cannot"):
        parameters.update({"brightness": 9})
    assert parameters.current == before


def test_they_outlast_a_change_that_opens_the_device_anew(
    runtime: LocalRuntime, device: Device
) -> None:
    parameters = runtime.parameters["camera"]
    parameters.update({"brightness": -10})
    device.values[BRIGHTNESS] = 5  # as after a loss of power
    parameters.update({"size": "32x24"})
    wait_for(lambda: device.values[BRIGHTNESS] == -10, "the control to be set again")
    parameters.update({"size": "nonsense"})
    wait_for(lambda: parameters.current.size == "32x24", "the size to be taken back")
    assert parameters.current.brightness == -10


def test_the_command_line_sets_them(device: Device, caplog: pytest.LogCaptureFixture) -> None:
    asked = ("--set", "camera.brightness=7", "--set", "camera.exposure_time_absolute=200")
    assert main(["camera", DEVICE, *asked, *QUICK]) == 0
    assert device.set == [(BRIGHTNESS, 7)]
    assert "camera /dev/null: exposure_time_absolute=200: Permission denied" in caplog.text


@pytest.mark.parametrize(
    ("asked", "expected"),
    [
        ("brightness=65", "camera: brightness=65: must be from -64 to 64"),
        ("focus=3", "camera: no parameter 'focus'; did you mean focus_"),
        ("auto_exposure=1", "auto_exposure=1: choose one of manual_mode, aperture_priority_mode"),
    ],
)
def test_what_the_device_lacks_is_refused_in_one_line(
    device: Device, asked: str, expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["camera", DEVICE, "--set", f"camera.{asked}", *QUICK]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert expected in said
    assert device.set == []


@pytest.mark.parametrize("name", ["camera", "pipeline"])
def test_on_a_graph_they_start_as_given_and_are_offered(device: Device, name: str) -> None:
    hub = Hub()
    given = {"uri": DEVICE, "brightness": -3, "auto_exposure": "manual_mode"}
    if name == "pipeline":
        given = {"source": "camera"} | {f"camera__{key}": value for key, value in given.items()}
    place = "/camera" if name == "camera" else "/pipeline/camera"
    with hub.running(name, **given):
        wait_for(lambda: place in hub.parameters, "the parameters")
        _, parameters = hub.parameters[place]
        assert parameters.current.brightness == -3
        parameters.update({"exposure_time_absolute": 99})
    assert device.set == [(AUTO, MANUAL), (BRIGHTNESS, -3), (EXPOSURE, 99)]
