"""Pictures with known landmarks, rendered by the simulator.

    python training/pictures.py OUT --worlds 100

Each world gets a folder ``OUT/world_<seed>_<number>`` with JPEG files and ``labels.json``: the
classes, and for each file a list of [class, x0, y0, x1, y1, point u, point v, share seen],
the last one negative where nobody could recognise it.
"""

from __future__ import annotations

import argparse
import copy
import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import advice  # noqa: F401
import cv2
import numpy as np
import numpy.typing as npt
from degrade import degrade
from grounds import Canvas
from running import run
from shots import Seen, hide_landmarks, take_shot
from visibility import judge
from worlds import build_world

SIZE = 320, 320
PER_WORLD = 160
_QUALITY = 40, 96  # of JPEG


def render_world(
    seed: tuple[int, ...],
    count: int = PER_WORLD,
    size: tuple[int, int] = SIZE,
    held_out: bool = False,
    own: Sequence[Path] = (),
) -> Iterator[tuple[Canvas, list[Seen], tuple[str, ...]]]:
    """Pictures of one world: RGB, what is seen in it, and the names of the classes.

    Raises:
        OpenError: there is no OpenGL to render with; the message says what to install.
    """
    from ros_visualise.simulation.rendering import Renderer

    random = np.random.default_rng(seed)
    world = build_world(random, held_out, own)
    world.model.vis.global_.offwidth, world.model.vis.global_.offheight = size
    renderer = Renderer(world.model, size)
    try:
        for _ in range(count):
            view, seen = take_shot(world, random, size)
            half = size[1] / 2 / view.focal
            world.model.cam_fovy[0] = 2 * np.degrees(np.arctan(half))
            picture = renderer.render(world.data, view.position_xyz, view.R_map_camera)
            again = copy.deepcopy(random)
            picture = degrade(random, picture)
            bare = picture
            if seen:
                hide_landmarks(world)
                bare = renderer.render(world.data, view.position_xyz, view.R_map_camera)
                bare = degrade(again, bare)
            yield picture, [judge(one, picture, bare) for one in seen], world.classes
    finally:
        renderer.close()


def write_world(
    folder: Path,
    seed: tuple[int, ...],
    count: int = PER_WORLD,
    size: tuple[int, int] = SIZE,
    held_out: bool = False,
    own: Sequence[Path] = (),
) -> None:
    """Write one world's pictures; the labels come last, so a folder with labels is whole."""
    folder.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng((*seed, 1))
    labels: dict[str, list[list[float]]] = {}
    classes: tuple[str, ...] = ()
    for picture, seen, names in render_world(seed, count, size, held_out, own):
        classes, file = names, f"{len(labels):04d}.jpg"
        setting = [cv2.IMWRITE_JPEG_QUALITY, int(random.integers(*_QUALITY))]
        cv2.imwrite(str(folder / file), picture[..., ::-1], setting)
        labels[file] = [row(one) for one in seen]
    written = json.dumps({"classes": classes, "pictures": labels})
    fresh = folder / "labels.new"
    fresh.write_text(written)
    fresh.replace(folder / "labels.json")


def row(seen: Seen) -> list[float]:
    """One line of ``labels.json``."""
    numbers: npt.NDArray[np.float64] = np.concatenate([seen.box, seen.point, [seen.share]])
    return [seen.kind, *(round(float(each), 3) for each in numbers)]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of both pictures and training."""
    parser.add_argument(
        "--seed", type=int, default=0, help="seed of the worlds (default: %(default)s)"
    )
    parser.add_argument(
        "--per-world",
        type=int,
        default=PER_WORLD,
        help="pictures of each world (default: %(default)s)",
    )
    parser.add_argument(
        "--body",
        type=Path,
        action="append",
        default=[],
        metavar="FILE.xml",
        help="MJCF file whose first body becomes an additional class; repeatable",
    )


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path, help="folder to write to")
    parser.add_argument(
        "--worlds", type=int, default=10, help="number of worlds (default: %(default)s)"
    )
    parser.add_argument(
        "--first", type=int, default=0, help="number of the first world (default: %(default)s)"
    )
    parser.add_argument(
        "--step", type=int, default=1, help="step between their numbers (default: %(default)s)"
    )
    parser.add_argument(
        "--side", type=int, default=SIZE[0], help="side of a picture, pixels (default: %(default)s)"
    )
    parser.add_argument(
        "--held-out", action="store_true", help="use the styles that training never uses"
    )
    add_arguments(parser)
    asked = parser.parse_args()
    for number in range(asked.first, asked.first + asked.worlds, asked.step):
        folder = asked.out / f"world_{asked.seed}_{number}"
        if not (folder / "labels.json").exists():
            size = asked.side, asked.side
            seed = asked.seed, number
            write_world(folder, seed, asked.per_world, size, asked.held_out, asked.body)
        print(folder)
    return 0


if __name__ == "__main__":
    run(main)
