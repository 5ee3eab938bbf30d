"""Trajectories from Python: the error by distance driven, and files for evo.

python examples/12_compare_trajectories.py drive.bag /odom /ground_truth/odom
"""

import sys

import ros_visualise as rv

if len(sys.argv) != 4:
    sys.exit(__doc__)
path, estimated, true = sys.argv[1:]
truth = rv.trajectory(path, true)
odometry = rv.trajectory(path, estimated)
print(f"{odometry.length_m:.1f} m driven in {odometry.duration_s:.0f} s")
for metres in (1, 2, 5):
    errors = odometry.errors(truth, align="origin", delta=f"{metres}m")
    rpe = errors.summary()["rpe_m"]
    print(f"over {metres} m: {rpe['rmse']:.3f} m, {100 * rpe['rmse'] / metres:.1f}%")
odometry.align(truth, "se3").to_tum("odometry.tum", overwrite=True)
truth.to_tum("truth.tum", overwrite=True)
