"""The parts that ROS 2 alone has: its messages, services, parameters and clock, over rclpy."""
