"""A calibration for the images that the sources' tests make."""

from pathlib import Path

import pytest

CALIBRATION = """\
image_width: 32
image_height: 24
camera_matrix: {rows: 3, cols: 3, data: [20, 0, 15.5, 0, 20, 11.5, 0, 0, 1]}
distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
projection_matrix: {rows: 3, cols: 4, data: [20, 0, 15.5, 0, 0, 20, 11.5, 0, 0, 0, 1, 0]}
"""


@pytest.fixture
def calibration(tmp_path: Path) -> str:
    """A file for images of 32x24, with a focal length of 20 pixels."""
    path = tmp_path / "ost.yaml"
    path.write_text(CALIBRATION)
    return str(path)
