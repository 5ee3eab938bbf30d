"""`ros-visualise bag` with messages that nobody can use: it says so, and plays the others."""

from played_bags import QUICK, image, images, write_bag


def no_pixels(stamp_ns):
    return image(stamp_ns, width=0, height=0)


def test_an_image_without_pixels_is_damaged(run, tmp_path, caplog):
    bag = write_bag(tmp_path / "r.bag", zero=images(no_pixels))
    _, said = run("bag", bag, *QUICK)
    assert "fps_control: 5 of 5 left out by damaged" in said
    assert "/zero: sensor_msgs/msg/Image: an image of 0x0 pixels" in caplog.text
    assert "Traceback" not in caplog.text
