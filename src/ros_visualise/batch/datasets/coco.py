"""COCO: pictures, and a JSON file of all boxes for each split.

Source: https://cocodataset.org/#format-data
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ros_visualise.batch.datasets import SPLITS, DatasetSource, labelled_images, provenance


def write(source: DatasetSource, folder: Path) -> int:
    """Write a data set; the number of its pictures."""
    images: dict[str, list[dict[str, Any]]] = {split: [] for split in SPLITS}
    boxes: dict[str, list[dict[str, Any]]] = {split: [] for split in SPLITS}
    labels: set[str] = set()
    for number, one in enumerate(labelled_images(source, folder), 1):
        size = {"width": one.width, "height": one.height}
        images[one.split].append({"id": number, "file_name": one.file, **size, **one.origin})
        labels.update(one.found.labels)
        for label, box in zip(one.found.labels, one.found.boxes.tolist(), strict=True):
            boxes[one.split].append(
                {
                    "id": len(boxes["train"]) + len(boxes["val"]) + 1,
                    "image_id": number,
                    "category_id": label,
                    "bbox": box,
                    "area": box[2] * box[3],
                    "iscrowd": 0,
                }
            )
    numbers = {label: number for number, label in enumerate(sorted(labels), 1)}
    (folder / "annotations").mkdir(parents=True)
    for split in SPLITS:
        for box in boxes[split]:
            box["category_id"] = numbers[box["category_id"]]
        values = {
            "info": provenance(source),
            "images": images[split],
            "annotations": boxes[split],
            "categories": [{"id": number, "name": label} for label, number in numbers.items()],
        }
        path = folder / "annotations" / f"instances_{split}.json"
        path.write_text(json.dumps(values))
    return sum(map(len, images.values()))
