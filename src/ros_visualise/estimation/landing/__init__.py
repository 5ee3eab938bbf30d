"""Landing targets: their pose relative to the robot, also while they move."""
