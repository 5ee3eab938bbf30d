"""Visual-inertial odometry: the motion of a robot by one camera and an IMU."""
