"""KITTI folders to read, and to change."""

import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from ros_visualise.sources.kitti import open_kitti
from ros_visualise.sources.recordings.series import SeriesRecording


@pytest.fixture(scope="session")
def drive_0009(recordings: Path) -> Path:
    """Five whole frames, with calibration beside the drive's folder."""
    return recordings / "kitti/drive0009_f000-004/2011_09_26/2011_09_26_drive_0009_sync"


@pytest.fixture(scope="session")
def drive_0052(recordings: Path) -> Path:
    """Four frames whose images and scans have no times."""
    return recordings / "kitti/drive0052_f000-003/2011_09_26/2011_09_26_drive_0052_sync"


@pytest.fixture(scope="session")
def drive_0016(recordings: Path) -> Path:
    """Nothing but the OXTS."""
    return recordings / "oxts/2011_09_30_drive_0016_sync"


def _link(source: str, target: str) -> None:
    os.symlink(source, target)


@pytest.fixture
def changeable(drive_0009: Path, tmp_path: Path) -> Path:
    """Drive 0009, its files as links that a test may replace."""
    date = tmp_path / "2011_09_26"
    shutil.copytree(drive_0009.parent, date, copy_function=_link)
    for folder in [date, *date.rglob("*")]:
        if folder.is_dir():
            folder.chmod(0o755)
    return date / drive_0009.name


@pytest.fixture
def opened() -> Iterator[Callable[[Path], SeriesRecording]]:
    """`open_kitti`, closed at the end."""
    recordings: list[SeriesRecording] = []

    def open_it(path: Path) -> SeriesRecording:
        recordings.append(open_kitti(path))
        return recordings[-1]

    yield open_it
    for one in recordings:
        one.close()
