"""Reading a recording from Python: the longest time that the robot stood still.

python examples/11_read_a_bag.py drive.bag /odom
"""

import sys

import numpy as np

import ros_visualise as rv

if len(sys.argv) != 3:
    sys.exit(__doc__)
path, topic = sys.argv[1:]
began_ns, longest_ns = None, 0
for sample in rv.messages(path, topic, kind=rv.Odometry):
    if np.linalg.norm(sample.message.linear_xyz) > 0.02:
        began_ns = None
        continue
    began_ns = sample.stamp_ns if began_ns is None else began_ns
    longest_ns = max(longest_ns, sample.stamp_ns - began_ns)
print(f"longest stop: {longest_ns / 1e9:.1f} s")
