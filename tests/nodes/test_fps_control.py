import numpy as np

from ros_visualise.data import Header, Image
from ros_visualise.nodes.fps_control import FpsControl, FpsParams


def image(stamp_ns):
    return Image(np.zeros((1, 1), np.uint8), "mono8", Header(stamp_ns, "camera"))


def run(params, stamps_ns):
    control = FpsControl(params)
    images = [image(stamp) for stamp in stamps_ns]
    answers = [
        control.step(one, params, 10**12 + came_ns)
        for one, came_ns in zip(images, STAMPS, strict=True)
    ]
    assert all(answer is None or answer is one for answer, one in zip(answers, images, strict=True))
    return sum(answer is not None for answer in answers)


S = 1_000_000_000
STAMPS = [round(i * 1e9 / 30) for i in range(300)]


def test_zero_counts_as_one():
    assert run(FpsParams(fps=0), STAMPS) == run(FpsParams(fps=1), STAMPS) == 10


def test_disabled_it_passes_everything():
    assert run(FpsParams(fps=1, enabled=False), STAMPS) == 300


def test_a_stream_without_stamps_goes_by_the_time_of_arrival():
    assert run(FpsParams(fps=15), [0] * 300) == 150


def test_a_stream_that_starts_at_zero_goes_by_its_stamps():
    assert run(FpsParams(fps=15), STAMPS) == 150


def test_it_reports_what_was_asked_for():
    control = FpsControl(FpsParams())
    control.step(image(0), FpsParams(fps=0), 0)
    assert control.report() == {"requested_hz": 1}
    control.step(image(1), FpsParams(enabled=False), 1)
    assert control.report() == {"requested_hz": None}


def test_after_a_jump_of_time_the_next_frame_passes():
    control, params = FpsControl(FpsParams()), FpsParams(fps=1)
    assert control.step(image(5 * S), params, 0) is not None
    assert control.step(image(5 * S + S // 2), params, 0) is None
    control.reset()
    assert control.step(image(5 * S + S * 6 // 10), params, 0) is not None
