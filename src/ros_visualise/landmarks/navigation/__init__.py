"""Where the robot is in a map of landmarks: a filter that corrects its odometry by what it sees."""
