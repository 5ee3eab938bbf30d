"""YOLO: pictures, a text file of boxes for each, and ``data.yaml``.

Source: https://docs.ultralytics.com/datasets/detect/
"""

from __future__ import annotations

import logging
from pathlib import Path

from ros_visualise.batch.datasets import SPLITS, DatasetSource, labelled_images, provenance
from ros_visualise.core.yaml_files import to_yaml

log = logging.getLogger(__name__)


def write(source: DatasetSource, folder: Path) -> int:
    """Write a data set; the number of its pictures."""
    written = list(labelled_images(source, folder))
    names = sorted({label for one in written for label in one.found.labels})
    for one in written:
        path = folder / "labels" / Path(one.file).relative_to("images").with_suffix(".txt")
        path.parent.mkdir(parents=True, exist_ok=True)
        lines = []
        for label, box in zip(one.found.labels, one.found.boxes.tolist(), strict=True):
            left, top, wide, tall = box
            middle = (left + wide / 2) / one.width, (top + tall / 2) / one.height
            numbers = (*middle, wide / one.width, tall / one.height)
            lines.append(f"{names.index(label)} {' '.join(f'{n:.6f}' for n in numbers)}\n")
        path.write_text("".join(lines))
    there = [split for split in SPLITS if any(one.split == split for one in written)]
    if len(there) == 1:  # Ultralytics needs both
        log.warning("all images are in one split, %s; data.yaml uses it for both splits", there[0])
    values = {
        **{split: f"images/{split if split in there else there[0]}" for split in SPLITS},
        "names": dict(enumerate(names)),
        **provenance(source),
        "origins": {one.file: f"{one.origin['recording']} {one.origin['t_ns']}" for one in written},
    }
    (folder / "data.yaml").write_text(to_yaml(values))
    return len(written)
