"""Sensors: they turn the true state into measurements. Only the lidar and camera know MuJoCo.

Each has its own random numbers, so that adding a sensor changes no other's data.
"""
