"""Robots simulated by MuJoCo, with their sensors, in worlds."""
