"""Zenoh as a transport: pipelines on several machines without ROS, laid out as rmw_zenoh does."""
