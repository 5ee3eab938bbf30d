"""Visual odometry: the motion of one or two cameras by what they see."""
