"""Where a landing target is from the robot, however it moves."""
