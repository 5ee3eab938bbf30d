"""Aligning a film with a gyroscope by the motion of its images."""

from contextlib import closing

import av
import cv2
import numpy as np
import pytest

from ros_visualise.data import Header, Imu
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import open_recorder
from ros_visualise.sources.alignment import NoAlignment, align, read_offsets
from ros_visualise.sources.opening import open_joined

FPS, SECONDS, LATE_S = 25, 12, 3.217
WIDTH, HEIGHT = 160, 120


@pytest.fixture(scope="module")
def rates():
    """A shaken camera: times and angular velocities, 100 a second for 20 s."""
    rng = np.random.default_rng(3)
    smooth = np.exp(-(np.linspace(-3, 3, 41) ** 2))
    white = rng.normal(size=(2000, 3))
    columns = [np.convolve(one, smooth / smooth.sum(), "same") for one in white.T]
    return np.arange(2000) / 100, np.stack(columns, axis=1) * [0.5, 0.5, 1.5]


@pytest.fixture(scope="module")
def film(rates, tmp_path_factory):
    """What that camera sees, from 3.217 s on, while it also drifts over the picture."""
    path = tmp_path_factory.mktemp("film") / "film.mp4"
    times, turned = rates
    angles = np.cumsum(turned, axis=0) / 100
    rng = np.random.default_rng(4)
    ground = cv2.GaussianBlur(rng.integers(0, 255, (600, 600), np.uint8), (0, 0), 2)
    ground = cv2.normalize(ground, None, 0, 255, cv2.NORM_MINMAX)
    with av.open(str(path), "w") as out:
        stream = out.add_stream("mpeg4", rate=FPS)
        stream.width, stream.height, stream.bit_rate = WIDTH, HEIGHT, 2_000_000
        for number in range(FPS * SECONDS):
            at = [np.interp(number / FPS + LATE_S, times, one) for one in angles.T]
            cosine, sine = np.cos(at[2]), np.sin(at[2])
            shift = 140 * np.array(at[:2]) + [0.3 * number, 5 * np.sin(number / 40)]
            turn = np.array([[cosine, -sine], [sine, cosine]])
            middle = np.array([300, 300]) + shift - turn @ [WIDTH / 2, HEIGHT / 2]
            model = np.column_stack([turn, middle])
            size, how = (WIDTH, HEIGHT), cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
            image = cv2.warpAffine(ground, model, size, flags=how, borderMode=cv2.BORDER_REFLECT)
            frame = av.VideoFrame.from_ndarray(image, format="gray").reformat(format="yuv420p")
            out.mux(stream.encode(frame))
        out.mux(stream.encode())
    return path


@pytest.fixture
def logged(rates, tmp_path):
    """A recording of that gyroscope, mounted in another way than the camera."""
    path = tmp_path / "log.mcap"
    recorder = open_recorder(path, {"/imu/data": TopicType(Imu.type_name)}, live=False)
    for time_s, rate in zip(*rates, strict=True):
        stamp_ns = round(time_s * 1e9) + 1
        imu = Imu(
            np.array([0.0, 0, 0, 1]), rate[[2, 0, 1]], np.zeros(3), header=Header(stamp_ns, "imu")
        )
        recorder.write("/imu/data", imu, stamp_ns)
    recorder.close()
    return path


def test_a_film_is_aligned_by_its_motion(film, logged, capsys):
    """Within its own uncertainty, from either side, and told with it."""
    with closing(open_joined([film, logged])) as joined:
        offset, still = read_offsets(["film=auto"], joined)
        assert still == 0
        assert offset == pytest.approx(LATE_S, abs=0.01)
        said = capsys.readouterr().err
        assert 0 < float(said.split("+-")[1].split()[0]) < 0.02
        assert read_offsets(["film=2", "log=auto"], joined)[1] == pytest.approx(
            2 - LATE_S, abs=0.01
        )


def test_another_film_is_not_aligned(rates):
    rng = np.random.default_rng(5)
    pairs = np.column_stack([np.arange(200), np.arange(1, 201)]) / 25
    with pytest.raises(NoAlignment, match="at several offsets, or at none"):
        align(pairs, rng.normal(size=(200, 3)), *rates)
    with pytest.raises(NoAlignment, match="too few images"):
        align(pairs[:10], rng.normal(size=(10, 3)), *rates)


def test_offsets_are_drawn_within_their_uncertainties(rates):
    """With motion of the camera that the gyroscope does not feel, in five films."""
    rng, (times, turned) = np.random.default_rng(6), rates
    angles = np.cumsum(turned, axis=0) / 100
    errors = []
    for _ in range(5):
        late = rng.uniform(0, 8)
        pairs = np.column_stack([np.arange(300), np.arange(1, 301)]) / 30
        seen = np.stack([np.interp(pairs + late, times, one) for one in angles.T], axis=-1)
        motion = np.diff(seen, axis=1)[:, 0] @ rng.normal(size=(3, 3)) * 30
        travel = np.cumsum(rng.normal(size=(300, 3)), axis=0)
        noise = rng.standard_t(3, size=(300, 3)) * 0.3 + 0.3 * travel / travel.std(axis=0)
        found = align(pairs, motion + noise * motion.std(axis=0), *rates)
        errors.append((found.offset_s - late) / found.sigma_s)
    assert np.sqrt(np.mean(np.square(errors))) < 1.5
