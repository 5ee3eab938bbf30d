"""Estimation: where the robot is, and where landmarks are, each with its uncertainty.

One filter for all sensors, an error-state Kalman filter. What happens at one time is an *event*: an
odometry message, an image, a reading of another sensor. A `Belief` and the next event give the next
belief (`filter`); a window keeps the beliefs of the last half second, so that late measurements
count at their own time (`window`).

- `robot`, `state`: what is estimated, and its covariance; errors are twists of the map
  (`ros_visualise.geometry.se3`).
- `odometry`, `imu`: propagate the robot from one event to the next.
- `camera_view`, `measuring`, `updating`: landmarks in an image correct the state.
- `landmark`, `points`, `landmark_map`: the map: what joins it, leaves it, or rests.
- `sensors`: all others, a file each.
- `gates`, `pose_search`: what to do with what does not fit.

Beside it: `localization`, landmarks from a robot whose pose is given, with errors; `landing`, a
target that moves; `mapping`, all of a recording at once; `visual` and `inertial`, odometry by eye.
"""

from ros_visualise.estimation import imu, measuring, odometry, updating  # noqa: F401 (own states)
from ros_visualise.estimation.sensors import SENSORS

tuple(SENSORS.all())  # each asks for its own states before the first state is made
