"""`ros-visualise odometry` on a film that comes back: the trajectory is closed, and says so."""

import json
from itertools import pairwise

import cv2
import numpy as np
import pytest
from visual_flight import HEIGHT, Flight

from ros_visualise.commands import main
from ros_visualise.commands.odometry.places import PlacesReport, Return

NUMBERS = [*range(30), *range(28, 3, -1)]


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    """A folder of pictures of a flight there and back, with its calibration."""
    folder, flight = tmp_path_factory.mktemp("film"), Flight()
    for place, number in enumerate(NUMBERS):
        cv2.imwrite(str(folder / f"{place:03}.png"), flight.image(number))
    P = np.column_stack([flight.info.K, np.zeros(3)])
    (folder / "calib.txt").write_text("P0: " + " ".join(map(str, P.ravel())) + "\n")
    return folder


def run(film, out, capsys, monkeypatch, *options):
    monkeypatch.setattr("signal.signal", lambda *_: None)
    common = ["--height", str(HEIGHT), "--corners", "120", "--overwrite"]
    status = main(["odometry", str(film), *common, f"--out={out}.kitti", *options])
    said = capsys.readouterr()
    assert status == 0, said.err
    return np.loadtxt(f"{out}.kitti").reshape(-1, 3, 4)[:, :, 3], said.out


def test_the_trajectory_is_closed(film, tmp_path, capsys, monkeypatch):
    covariances = tmp_path / "P.txt"
    files = f"--covariances={covariances}"
    kept, said = run(film, tmp_path / "open", capsys, monkeypatch, "--keep-drift", "--json", files)
    assert json.loads(said)["places"]["returns"] == []
    assert np.isfinite(np.loadtxt(covariances)).all()
    closed, said = run(film, tmp_path / "closed", capsys, monkeypatch, "--json", files)
    after = np.loadtxt(covariances)[:, 1:].reshape(-1, 6, 6)
    report = json.loads(said)
    assert report["end_sigma"] == pytest.approx(np.sqrt(np.trace(after[-1, :3, :3])), rel=1e-3)
    assert np.linalg.eigvalsh(after).min() > 0
    assert 0.01 < report["end_sigma"] < 0.1
    report = report["places"]
    assert len(report["returns"]) == 1
    seen = report["returns"][0]
    assert seen["points"] >= 30
    assert 0 <= seen["before_s"] < seen["start_s"] <= seen["end_s"] <= len(NUMBERS) / 10
    true = np.array([Flight().motion(0, number)[1] for number in NUMBERS])
    error = np.linalg.norm(closed - true, axis=1)
    way = sum(np.linalg.norm(b - a) for a, b in pairwise(true))
    assert error[-1] < np.linalg.norm(kept[-1] - true[-1])
    assert error[-1] < 0.01 * way
    off, P = (closed - true)[-len(after) :, :, None], after[:, :3, :3]
    assert (np.swapaxes(off, 1, 2) @ np.linalg.pinv(P) @ off).mean() < 6  # 3 is right
    assert report["moved"] == pytest.approx(np.linalg.norm(closed - kept, axis=1).max(), abs=0.02)


def test_what_was_closed_is_printed():
    returns = [Return(12.0, 14.5, 2.25, 7, 41)]
    assert PlacesReport(returns, 0.1234, 2, 3).lines(" m") == [
        "closed:    12.0 to 14.5 s, at places first seen at 2.2 s"
        " (7 keyframes, 41 or more points each)",
        "moved:     by up to 0.123 m",
        "rejected:  2 closures (contradicted by the odometry)",
        "rejected:  3 closures (similar to several places)",
    ]
    assert PlacesReport([], 0.0, 0, 0).lines(" m") == []
