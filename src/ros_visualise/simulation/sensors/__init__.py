"""Sensors: from what is true to what is measured. None of them knows MuJoCo but the lidar.

Each has a stream of random numbers of its own, so that one more sensor changes no other's data.
"""
