"""Pictures of boards by cameras whose numbers are known."""

from __future__ import annotations

import cv2
import numpy as np

from ros_visualise.landmarks.calibration.boards import Board, dark_rectangles, outer_size
from ros_visualise.landmarks.calibration.lenses import LensModel, to_rays

_FINE = 2  # rays along a pixel's side


def texture(board: Board, pixels_per_m: float, rim: float) -> np.ndarray:
    """The board, gray, with a white rim of so many metres; edges lie on pixels' edges or near."""
    width, height = outer_size(board)
    to_px = lambda metres: np.rint((metres + rim) * pixels_per_m).astype(int)  # noqa: E731
    drawn = np.full(to_px(np.array([height + rim, width + rim])), 235, np.uint8)
    for x, y, w, h in dark_rectangles(board):
        left, top, right, bottom = to_px(np.array([x, y, x + w, y + h]))
        drawn[top:bottom, left:right] = 20
    return drawn


class Studio:
    """A camera before a board.

    Args:
        numbers: the camera's.
        model: of its lens.
        size: of the pictures.
    """

    def __init__(self, board: Board, numbers, model: LensModel, size: tuple[int, int]) -> None:
        self._board, self.size = board, size
        self._rim = 1.5 * board.square
        self._scale = 60 / board.square
        self._texture = texture(board, self._scale, self._rim)
        at = [(np.arange(side * _FINE) + 0.5) / _FINE - 0.5 for side in size]
        uv = np.stack(np.meshgrid(*at), axis=2).reshape(-1, 2)
        self._rays = np.column_stack(
            [to_rays(uv, np.asarray(numbers, float), model), np.ones(len(uv))]
        )

    def take(self, pose, random: np.random.Generator, noise: float = 2.0, blur: float = 0.6):
        """A picture of the board at a pose (6,): rotation vector, translation."""
        H = np.column_stack([cv2.Rodrigues(np.array(pose[:3], float))[0][:, :2], pose[3:]])
        seen = self._rays @ np.linalg.inv(H).T
        xy = (seen[:, :2] / seen[:, 2:] + self._rim) * self._scale - 0.5
        xy[seen[:, 2] <= 0] = -1e4
        width, height = self.size
        shape = (height * _FINE, width * _FINE)
        maps = [
            np.clip(xy[:, axis], -1e4, 1e4).reshape(shape).astype(np.float32) for axis in (0, 1)
        ]
        fine = cv2.remap(self._texture, *maps, cv2.INTER_LINEAR, borderValue=120)
        picture = cv2.resize(fine, self.size, interpolation=cv2.INTER_AREA).astype(np.float32)
        picture = cv2.GaussianBlur(picture, (0, 0), blur)
        picture += random.normal(0, noise, picture.shape)
        return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def poses_of(
    board: Board,
    count: int,
    random: np.random.Generator,
    distance: float,
    spread: float = 0.25,
    tilt: float = 0.5,
):
    """Poses of the board's middle around the optical axis, tilted to all sides.

    Args:
        distance: in lengths of the board.
        spread: of the board's middle, as a slope.
        tilt: rad, to each side.
    """
    width, height = outer_size(board)
    made = []
    for _ in range(count):
        turn = np.array([*random.uniform(-tilt, tilt, 2), random.uniform(-0.3, 0.3)])
        z = distance * width * random.uniform(0.75, 1.3)
        middle = np.array([*random.uniform(-spread, spread, 2) * z, z])
        offset = cv2.Rodrigues(turn)[0] @ [width / 2, height / 2, 0]
        made.append(np.concatenate([turn, middle - offset]))
    return made
