"""The runtime on a ROS 1 graph: the only place where rospy is imported."""
