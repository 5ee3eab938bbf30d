"""Text files of trajectories, as evo reads them; what is damaged is counted."""

import numpy as np
import pytest
from evo.tools import file_interface

from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.sources.trajectory_files import is_trajectory_file, read_trajectory_file

KITTI = "1 0 0 4 0 1 0 5 0 0 1 6\n"


@pytest.fixture
def write(tmp_path):
    def write(text):
        path = tmp_path / "way.txt"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


def test_tum_as_evo_reads_it(recordings):
    path = recordings / "trajectory" / "evo" / "freiburg1_xyz-groundtruth.txt"
    found, evo = read_trajectory_file(path), file_interface.read_tum_trajectory_file(path)
    assert (found.stamped, found.turns, found.skipped) == (True, True, {})
    np.testing.assert_allclose(found.path.stamps_ns / 1e9, evo.timestamps, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(found.path.positions_xyz, evo.positions_xyz)
    np.testing.assert_array_equal(
        found.path.quats_xyzw[:, [3, 0, 1, 2]], evo.orientations_quat_wxyz
    )


def test_kitti_as_evo_reads_it(recordings):
    path = recordings / "trajectory" / "evo" / "KITTI_00_gt.txt"
    found, evo = read_trajectory_file(path), file_interface.read_kitti_poses_file(path)
    assert (found.stamped, found.turns) == (False, True)
    np.testing.assert_array_equal(found.path.positions_xyz, evo.positions_xyz)
    same = np.abs((found.path.quats_xyzw[:, [3, 0, 1, 2]] * evo.orientations_quat_wxyz).sum(1))
    np.testing.assert_allclose(same, 1, atol=1e-6)


EUROC = """\
#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []\
, v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1]\
, b_w_RS_S_y [rad s^-1], b_w_RS_S_z [rad s^-1], b_a_RS_S_x [m s^-2], b_a_RS_S_y, b_a_RS_S_z
1403636580838555648,4.5,-1.75,0.75,0.5,-0.5,0.5,-0.5,-0.027,0.03,0.08,-0.002,0.02,0.07,-0.01,0.1,0.09
1403636580843555328,4.6,-1.80,0.75,0.6,-0.8,0.0,0.0,-0.027,0.03,0.08,-0.002,0.02,0.07,-0.01,0.1,0.09
"""


@pytest.mark.parametrize("columns", [17, 8])
@pytest.mark.parametrize("comma", [",", ", "])
@pytest.mark.parametrize("header", [True, False])
def test_euroc_as_evo_reads_it(write, columns, comma, header):
    lines = [comma.join(line.split(",")[:columns]) for line in EUROC.splitlines()]
    path = write("\n".join(lines[0 if header else 1 :]) + "\n")
    assert is_trajectory_file(path)
    found, evo = read_trajectory_file(path), file_interface.read_euroc_csv_trajectory(path)
    assert (found.stamped, found.turns, found.skipped) == (True, True, {})
    assert found.path.stamps_ns.tolist() == [1403636580838555648, 1403636580843555328]
    np.testing.assert_array_equal(found.path.positions_xyz, evo.positions_xyz)
    np.testing.assert_array_equal(
        found.path.quats_xyzw[:, [3, 0, 1, 2]], evo.orientations_quat_wxyz
    )


@pytest.mark.parametrize(
    ("time", "stamp_ns"),
    [
        ("1633592510.6164725", 1633592510616472500),  # seconds, as INSANE writes them
        ("1.403636580838555648e+18", 1403636580838555648),
        ("250", 250),
    ],
)
def test_times_of_the_csv_are_nanoseconds_or_seconds_with_a_point(write, time, stamp_ns):
    found = read_trajectory_file(write(f"{time},1,2,3,1,0,0,0\n"))
    assert found.path.stamps_ns.tolist() == [stamp_ns]


def test_other_tables_are_no_trajectory(write):
    """An IMU's lines have too few numbers, others no quaternion."""
    assert not is_trajectory_file(write("1403636579758555392,-0.09,0.1,0.05,8.2,-0.2,-2.6\n"))
    assert not is_trajectory_file(write("1,2,3,4,5,6,7,8,9\n"))
    assert not is_trajectory_file(write("1e9999,2,3,4,1,0,0,0\n"))
    assert is_trajectory_file(write("# time, x, y, z and so on\n1 0 0 0 0 0 0 1\n"))
    assert read_trajectory_file(write("# t, x\n1 0 0 0 0 0 0 1\n")).path.quats_xyzw[0, 3] == 1


def test_stamps_are_exact(write):
    path = write("\ufeff# t x y z\n\n1700000000.123456789 1 2 3 0 0 0 1\n-0.5 1 2 3 0 0 0 1\r\n")
    found = read_trajectory_file(path)
    assert found.path.stamps_ns.tolist() == [-500_000_000, 1700000000123456789]
    assert found.unordered == 1


WRONG = ["2 x y z 0 0 0 1", "3 0 0 0 0", "4 nan 0 0 0 0 0 1", "1e300 0 0 0 0 0 0 1"]


@pytest.mark.parametrize("line", [*WRONG, "inf 0 0 0 0 0 0 1", "5 0 0 0 0 0 0 1 7"])
def test_a_damaged_line_is_counted_and_said(write, caplog, line):
    found = read_trajectory_file(write(f"1 0 0 0 0 0 0 1\n{line}\n9 0 0 0 0 0 0 1\n"))
    assert found.path.stamps_ns.tolist() == [10**9, 9 * 10**9]
    assert found.skipped == {"damaged": 1}
    assert "line 2 is not a pose" in caplog.text


def test_a_matrix_that_is_no_rotation_is_damaged(write):
    found = read_trajectory_file(write(KITTI + "2 0 0 4 0 1 0 5 0 0 1 6\n" + KITTI))
    assert found.skipped == {"damaged": 1}
    mirrored = "1 0 0 4 0 1 0 5 0 0 -1 6\n"
    with pytest.raises(RosVisualiseError, match="no poses on"):
        read_trajectory_file(write(mirrored))


def test_other_texts_are_none(write):
    for text in ("", "# nothing\n", "1 2 3\n", "a b c d e f g h\n", b"\x89MCAP0\r\n", b"\0" * 99):
        assert not is_trajectory_file(write(text))
    assert not is_trajectory_file(write("").parent / "none")
    assert is_trajectory_file(write(KITTI))
