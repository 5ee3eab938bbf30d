"""A folder of recordings in a table: length, duration and top speed of each drive.

python examples/19_bags_to_csv.py . drives.csv
"""

import csv
import sys
from pathlib import Path

import numpy as np

import ros_visualise as rv

if len(sys.argv) != 3:
    sys.exit(__doc__)
folder, target = sys.argv[1:]
with open(target, "w", newline="") as file:
    table = csv.writer(file)
    table.writerow(["file", "metres", "seconds", "metres per second"])
    for path in sorted(Path(folder).glob("*.bag")):
        try:
            drive = rv.trajectory(path, "/odom")
        except rv.RosVisualiseError as error:
            print(error, file=sys.stderr)
            continue
        ways = np.linalg.norm(np.diff(drive.positions_xyz, axis=0), axis=1)
        speeds = ways / np.maximum(np.diff(drive.stamps_ns) / 1e9, 1e-9)
        row = (drive.length_m, drive.duration_s, np.median(np.sort(speeds)[-50:]))
        table.writerow([path.name, *(f"{number:.2f}" for number in row)])
print(Path(target).read_text(), end="")
