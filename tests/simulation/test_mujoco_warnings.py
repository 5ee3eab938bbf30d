"""What MuJoCo warns of is said, and written nowhere."""

from ros_visualise.simulation.engine import load_mujoco

UNSTABLE = """
<mujoco><option timestep="1"/><worldbody>
  <body><freejoint/><geom size="1" mass="1e-9"/></body>
</worldbody></mujoco>
"""


def test_warnings_are_logged(tmp_path, monkeypatch, caplog):
    monkeypatch.chdir(tmp_path)
    mujoco = load_mujoco()
    model = mujoco.MjModel.from_xml_string(UNSTABLE)
    data = mujoco.MjData(model)
    data.qvel[:] = 1e30
    mujoco.mj_step(model, data)
    assert "simulation is unstable" in caplog.text
    assert list(tmp_path.iterdir()) == []
