"""Surveyed tags that were not given: `tagslam_held_out.py MAP.yaml SURVEY.yaml TAGSLAM.yaml`.

The map is that of `ros-visualise landmarks BAG --map MAP.yaml --survey SURVEY.yaml`, of TagSLAM's
example_10; the survey holds some of the tags of its tagslam.yaml. Prints the errors of the others.
"""

from __future__ import annotations

import sys

import numpy as np

from ros_visualise.core.yaml_files import load_yaml

SURVEYED_M = 1e-3  # what is given with a larger standard deviation is a guess


def main(map_file: str, survey_file: str, truth_file: str) -> None:
    """Print the worst errors, and their distribution."""
    (body,) = (b["top_floor"] for b in load_yaml(truth_file)["bodies"] if "top_floor" in b)
    true = {
        f"tag36h11_{tag['id']}": np.array([tag["pose"]["position"][axis] for axis in "xyz"])
        for tag in body["tags"]
        if max(tag["pose"]["position_noise"].values()) <= SURVEYED_M
    }
    given = {one["name"] for one in load_yaml(survey_file)["landmarks"]}
    off = {
        one["name"]: float(np.linalg.norm(one["pose"]["position"] - true[one["name"]]))
        for one in load_yaml(map_file)["landmarks"]
        if one["name"] in true.keys() - given
    }
    worst = sorted(off, key=lambda name: -off[name])[:3]
    print(", ".join(f"{name}: {off[name]:.2f} m" for name in worst))
    metres = np.array(list(off.values()))
    print(
        f"| {len(off)} | {metres.max():.2f} | {np.percentile(metres, 90):.2f} |"
        f" {np.median(metres):.3f} |"
    )


if __name__ == "__main__":
    main(*sys.argv[1:4])
