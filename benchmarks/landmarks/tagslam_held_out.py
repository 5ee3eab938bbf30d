"""Surveyed tags that were not given: `tagslam_held_out.py MAP SURVEY TAGSLAM [OTHER_MAP]`.

The map is that of `ros-visualise landmarks BAG --map MAP.yaml --survey SURVEY.yaml`, of TagSLAM's
example_10; the survey holds some of the tags of its tagslam.yaml. Prints the errors of the others,
and how many are inside 95% by their covariance, without and with the errors of the survey itself.
Another map, of the recording of another camera in the same building, tells what is wrong with the
survey: of all tags in both, how far the maps are apart.
"""

from __future__ import annotations

import sys

import numpy as np

from ros_visualise.core.yaml_files import load_yaml

SURVEYED_M = 1e-3  # what is given with a larger standard deviation is a guess
GATE = 7.815  # 95 % point of the chi-square distribution with 3 degrees of freedom


Places = dict[str, tuple[np.ndarray, np.ndarray]]
"""Name -> position and its covariance."""


def main(map_file: str, survey_file: str, truth_file: str, other_file: str = "") -> None:
    """Print the worst errors, and their distribution."""
    (body,) = (b["top_floor"] for b in load_yaml(truth_file)["bodies"] if "top_floor" in b)
    true = {
        f"tag36h11_{tag['id']}": np.array([tag["pose"]["position"][axis] for axis in "xyz"])
        for tag in body["tags"]
        if max(tag["pose"]["position_noise"].values()) <= SURVEYED_M
    }
    survey = load_yaml(survey_file)["landmarks"]
    given = {one["name"] for one in survey}
    sigma_m = float(np.mean([one.get("sigma", 0.01) for one in survey]))
    off, inside = {}, []
    found = places(map_file)
    for name, (place, own) in found.items():
        if name in true.keys() - given:
            error = place - true[name]
            both = own + sigma_m**2 * np.eye(3)
            off[name] = float(np.linalg.norm(error))
            inside.append([error @ np.linalg.solve(P, error) < GATE for P in (own, both)])
    worst = sorted(off, key=lambda name: -off[name])[:3]
    print(", ".join(f"{name}: {off[name]:.2f} m" for name in worst))
    metres, (alone, with_survey) = np.array(list(off.values())), 100 * np.mean(inside, axis=0)
    print(
        f"| {len(off)} | {metres.max():.2f} | {np.percentile(metres, 90):.2f} |"
        f" {np.median(metres):.3f} | {alone:.0f}% | {with_survey:.0f}% |"
    )
    if other_file:
        print(apart(found, places(other_file)))


def places(map_file: str) -> Places:
    """The tags of a map."""
    return {
        one["name"]: (
            np.array(one["pose"]["position"]),
            np.reshape(one["pose"]["covariance"], (6, 6))[:3, :3],
        )
        for one in load_yaml(map_file)["landmarks"]
    }


def apart(a: Places, b: Places) -> str:
    """The tags in both maps: number, worst and median distance, mean NEES, and how many inside."""
    metres, nees = [], []
    for name in a.keys() & b.keys() - {"tag36h11_420", "tag36h11_520"}:  # ids of later copies
        error = a[name][0] - b[name][0]
        metres.append(np.linalg.norm(error))
        nees.append(error @ np.linalg.solve(a[name][1] + b[name][1], error))
    inside = 100 * np.mean(np.array(nees) < GATE)
    return (
        f"| {len(nees)} | {max(metres):.2f} | {np.median(metres):.3f} | {np.mean(nees):.1f} |"
        f" {inside:.0f}% |"
    )


if __name__ == "__main__":
    main(*sys.argv[1:5])
