"""What everything else is written in; nothing here knows of ROS, pages or recordings."""
