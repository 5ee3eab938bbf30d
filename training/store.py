"""All pictures in the memory of the device, and the parts of them that are learned from."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import torch
from device import DEVICE
from shots import MOST_THINGS
from torch import Tensor

from ros_visualise.core.errors import OpenError

Canvas = npt.NDArray[np.uint8]
ABSENT = -1
"""The class of a row that is none."""
_EMPTY, _REAL = 0.5, 2.0
"""How often rendered pictures without a landmark and real pictures are shown, relative to others.
"""


class Store:
    """Pictures, the same at half their size, and the rows of their labels.

    Args:
        folder: of worlds, as `pictures.py` writes them. All pictures are square and equally large.
        worlds: there is room for so many rendered ones, and for all that are there already; those
            of 160 pictures of 320 pixels take 61 MB each.
    """

    def __init__(self, folder: Path, worlds: int) -> None:
        self.folder, self.count, self.side = folder, 0, 0
        self.classes: tuple[str, ...] = ()
        there, real = (len(list(folder.glob(f"*/{name}.json"))) for name in ("labels", "sources"))
        self.room = max(worlds + real, there)
        self._worlds: set[Path] = set()
        self._pixels = self._rows = self._real = torch.empty(0)

    @property
    def rows(self) -> Tensor:
        """(N, MOST_THINGS, 8) as in ``labels.json``; the class of those beyond is `ABSENT`."""
        return self._rows[: self.count]

    @property
    def real(self) -> Tensor:
        """(N,) bool: the pictures that `negatives.py` cut out of real ones."""
        return self._real[: self.count]

    @property
    def weights(self) -> Tensor:
        """(N,) how often each picture is shown."""
        shown = torch.where(self.rows[:, 0, 0] == ABSENT, _EMPTY, 1.0)
        return torch.where(self.real, _REAL, shown)

    def refresh(self) -> int:
        """Take in the worlds that have become whole, while there is room; how many are there."""
        if len(self._worlds) < self.room:
            new = set(self.folder.glob("*/labels.json")) - self._worlds
            for path in sorted(new)[: self.room - len(self._worlds)]:
                self._add(path)
        return len(self._worlds)

    def _add(self, path: Path) -> None:
        labels = json.loads(path.read_text())
        classes = tuple(labels["classes"])
        if self.classes not in ((), classes):
            told = f"{', '.join(classes)}, where other worlds have {', '.join(self.classes)}"
            raise OpenError(f"{path.parent}: has the classes {told}: give a folder of its own")
        with ThreadPoolExecutor() as pool:
            files = [path.parent / name for name in labels["pictures"]]
            pictures = np.stack(list(pool.map(_read_both, files)))
        count = len(files)
        if not self._worlds:
            self._make_room(pictures.shape[:2], classes)
        if pictures.shape[1] != self._pixels.shape[1] or self.count + count > len(self._rows):
            raise OpenError(f"{path.parent}: not as many or as large pictures as in other worlds")
        rows = np.full((count, MOST_THINGS, 8), ABSENT, np.float32)
        for number, some in enumerate(labels["pictures"].values()):
            rows[number, : len(some)] = np.reshape(some, (-1, 8))
        new = slice(self.count, self.count + count)
        self._pixels[new] = torch.from_numpy(pictures).to(DEVICE)
        self._rows[new] = torch.from_numpy(rows).to(DEVICE)
        self._real[new] = path.with_name("sources.json").exists()
        self._worlds.add(path)
        self.count += count

    def _make_room(self, world: tuple[int, ...], classes: tuple[str, ...]) -> None:
        count, pixels = self.room * world[0], world[1]
        self.side, self.classes = math.isqrt(pixels * 4 // 5), classes
        try:
            self._pixels = torch.empty(count, pixels, 3, dtype=torch.uint8, device=DEVICE)
        except RuntimeError as error:
            need = f"{count} pictures need {3e-9 * count * pixels:.1f} GB"
            raise OpenError(f"{need} of memory: ask for fewer --worlds") from error
        self._rows = torch.empty(count, MOST_THINGS, 8, device=DEVICE)
        self._real = torch.zeros(count, dtype=torch.bool, device=DEVICE)

    def cut(self, which: Tensor, x: Tensor, y: Tensor, half: Tensor) -> Tensor:
        """Parts (P, H, W, 3) of pictures, 0 to 1; beyond a picture's edges its last pixels go on.

        Args:
            which: (P,) numbers of the pictures.
            x, y: (P, W) and (P, H) where to look, pixels; centres are at whole numbers.
            half: (P,) bool, whether to look in the picture of half the size.
        """
        scale = torch.where(half, 0.5, 1.0)[:, None]
        width = torch.where(half, self.side // 2, self.side)[:, None]
        first = torch.where(half, self.side**2, 0)[:, None, None]
        left, right, across = _neighbours((x + 0.5) * scale - 0.5, width)
        upper, lower, down = _neighbours((y + 0.5) * scale - 0.5, width)

        def at(row: Tensor, column: Tensor) -> Tensor:
            cells = first + (row * width)[:, :, None] + column[:, None, :]
            return self._pixels[which[:, None, None], cells].float()

        across = across[:, None, :, None]
        above = torch.lerp(at(upper, left), at(upper, right), across)
        below = torch.lerp(at(lower, left), at(lower, right), across)
        return torch.lerp(above, below, down[:, :, None, None]) / 255


def _neighbours(at: Tensor, width: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """The pixels before and behind, and how far from the first to the second."""
    at = torch.minimum(at.clamp(min=0), (width - 1).float())
    before = at.floor()
    low = before.long()
    return low, torch.minimum(low + 1, width - 1), at - before


def _read_both(path: Path) -> Canvas:
    """The pixels (N, 3) of a picture, then those of the same at half its size."""
    whole = read(path)
    half = cv2.resize(whole, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    return np.concatenate([each.reshape(-1, 3) for each in (whole, np.asarray(half, np.uint8))])


def read(path: Path) -> Canvas:
    """A picture, RGB."""
    data = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if data is None:
        raise OpenError(f"{path}: no picture; remove its folder, and it is rendered again")
    return np.asarray(cv2.cvtColor(data, cv2.COLOR_BGR2RGB), np.uint8)


def some_pictures(folder: Path, seed: int) -> Iterator[npt.NDArray[np.float32]]:
    """Pictures (1, 3, H, W) of the worlds in a folder, RGB in 0 to 1, in a random order."""
    paths = [
        whole.parent / name
        for whole in sorted(folder.glob("*/labels.json"))
        for name in json.loads(whole.read_text())["pictures"]
    ]
    for number in np.random.default_rng(seed).permutation(len(paths)):
        picture = read(paths[number])
        yield np.ascontiguousarray(picture.transpose(2, 0, 1)[None] / np.float32(255))
