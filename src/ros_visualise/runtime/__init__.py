"""Runtimes of graphs: here, as a node of a ROS graph, or remote. The same nodes run in each."""
