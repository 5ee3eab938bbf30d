"""See what a robot sees: sensor data through nodes with live sliders, in a browser or on ROS."""
