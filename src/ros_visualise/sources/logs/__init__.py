"""Flight logs as recordings of ROS topics: PX4's ULog, and the subtitles of DJI's cameras."""
