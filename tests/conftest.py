"""What the tests share."""

import contextlib
import ctypes
import gc
import logging
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from ros_visualise.core.errors import OpenError
from ros_visualise.core.supervision import PROCESS

_OFF = [
    *("WebUIOmniboxPopup", "WebUIOmniboxAimPopup"),  # of each tab: as much work as a page of ours
    # as Playwright has them, whose list this one replaces
    *("AvoidCorsURLLoaderRestartOnRedirect", "AvoidUnnecessaryBeforeUnloadCheckSync"),
    *("DestroyProfileOnBrowserClose", "HttpsFirstBalancedModeAutoEnable", "HttpsUpgrades"),
    *("LensOverlay", "MediaRouter", "NetworkTimeServiceQuerying", "OptimizationHints"),
    *("PaintHolding", "PreconnectToSearch", "ThirdPartyStoragePartitioning"),
]
"""Features of the browser that no page needs."""
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    f"--disable-features={','.join(_OFF)}",
    "--host-resolver-rules=MAP evil.example 127.0.0.1",
]

os.environ["BROWSER"] = "true"  # a command that does nothing, should a test open one
# Mesa's compiler of shaders takes longer to optimize them than they run: the pixels are the same.
os.environ.setdefault("GALLIVM_PERF", "nopt")
# Collections of garbage take a quarter of the time in which tests are collected, and find none.
gc.disable()
# The kernel would clear the memory of each large array anew, which takes up to a sixth of the time.
with contextlib.suppress(AttributeError, OSError, TypeError):  # only glibc has it
    for _option in (-1, -3):  # M_TRIM_THRESHOLD and M_MMAP_THRESHOLD
        ctypes.CDLL(None).mallopt(_option, 2**29)


_LONGEST = {
    *("test_control_by_estimate", "test_contract", "test_tutorials", "test_newcomer_ros1"),
    *("test_site", "test_traces", "test_map_panel", "test_plugins", "test_aerial"),
    *("test_page_gate", "test_batch", "test_dataset", "test_contract_of_faults", "test_newcomer"),
    *("test_executables", "test_odometry_and_imu", "test_timeline_marks", "test_cli"),
    *("test_gallery", "test_true_numbers", "test_landmark_maps", "test_installation"),
}
"""Files that take a minute; begun first, none is what all other processes wait for at the end."""


_WAITING = {"links", "ros1", "ros2", "running", "runtime", "ui"}
"""Rooms whose tests mostly wait for other processes; beside them the others compute."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the files that take longest; spread those that wait among those that compute."""
    files = list(dict.fromkeys(item.path for item in items))
    files.sort(key=lambda path: path.stem not in _LONGEST)
    places = {}
    for kind in (False, True):
        of_kind = [path for path in files if (path.parent.name in _WAITING) == kind]
        places.update({path: at / len(of_kind) for at, path in enumerate(of_kind)})
    items.sort(key=lambda item: places[item.path])


def pytest_collection_finish() -> None:
    """Leave out of garbage collections what they would go through for a third of a second."""
    gc.collect()
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session")
def recordings() -> Path:
    """The folder of real recordings; a test that needs it is skipped where it is absent."""
    default = Path(__file__).parents[2] / "shared" / "data"
    folder = Path(os.environ.get("ROS_VISUALISE_DATA", default))
    if not folder.is_dir():
        if os.environ.get("CI"):
            pytest.fail(f"no recordings in {folder}: set ROS_VISUALISE_DATA")
        pytest.skip(f"no recordings in {folder}: set ROS_VISUALISE_DATA to run this")
    return folder


@pytest.fixture(scope="session")
def chromium() -> Iterator[object]:
    """One browser for all tests, skipped where there is none."""
    playwright = pytest.importorskip("playwright.sync_api")
    found = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("chrome")
    if found is None:
        if os.environ.get("CI"):
            pytest.fail("no chromium: apt-get install chromium")
        pytest.skip("no chromium: apt-get install chromium, to run this")
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=found, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def opengl() -> None:
    """OpenGL for simulated cameras; a test that needs it is skipped without."""
    from ros_visualise.simulation.rendering import choose_backend

    try:
        choose_backend()
    except OpenError as error:
        pytest.fail(str(error)) if os.environ.get("CI") else pytest.skip(str(error))


@pytest.fixture
def caplog(
    caplog: pytest.LogCaptureFixture, request: pytest.FixtureRequest
) -> Iterator[pytest.LogCaptureFixture]:
    """What is logged, but for rospy's threads: they outlive the tests in ros1, and log later."""
    if "ros1" not in request.path.parts:
        caplog.handler.addFilter(_is_not_of_rospy)
    yield caplog
    caplog.handler.removeFilter(_is_not_of_rospy)


def _is_not_of_rospy(record: logging.LogRecord) -> bool:
    return not record.name.startswith("rospy")


@pytest.fixture(autouse=True)
def nothing_failed_beside():
    """No thread fails silently; a test of one that does looks at its failures and forgets them."""
    PROCESS.forget()
    yield
    failures = PROCESS.failures
    PROCESS.forget()
    assert not failures
