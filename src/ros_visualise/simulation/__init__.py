"""Robots simulated by MuJoCo: a skid-steered rover and a quadrotor, with their sensors."""
