"""What is ROS 2's alone: its messages, services, parameters and clock, over rclpy."""
