"""The start of a run: options, playing, work that Ctrl-C interrupts, and ROS executables."""
