"""What the tests of the simulation need."""

import os

import pytest

if not os.environ.get("CI"):
    pytest.importorskip("mujoco", reason="pip install 'ros_visualise[sim]' to run this")
