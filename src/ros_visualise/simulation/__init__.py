"""Robots with sensors in worlds, simulated by MuJoCo."""
