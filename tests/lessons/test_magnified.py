"""Choosing a pixel of a lesson's picture by a click."""

import cv2
import numpy as np
import pytest

from ros_visualise.data import Image
from ros_visualise.lessons.lesson import FigureImage
from ros_visualise.lessons.magnifier import PixelParams, magnified, pixel_at


@pytest.mark.parametrize("shape", [(60, 100), (100, 60), (20, 20)])
def test_each_pixel_is_found_where_it_is_drawn(shape):
    """A picture of which one pixel is white is drawn; a click on any white place finds that one."""
    height, width = shape
    chosen = (width // 3, height // 2)
    picture = np.zeros(shape, np.uint8)
    picture[chosen[1], chosen[0]] = 255
    figure, zoom = magnified([picture, picture], chosen, 3)
    zoom.draw(picture)
    image = Image(FigureImage(figure), "bgr8")
    is_white = (image.pixels == 255).all(axis=2)
    edge = round(image.width * zoom.place(chosen[0] - 3.5, 0)[0] / figure.width)
    is_white[:, edge - 18 : edge + 2] = False  # the gap, and the page
    rows, columns = np.nonzero(cv2.erode(is_white.astype(np.uint8), np.ones((5, 5))))
    found = {
        pixel_at(image, (column + 0.5) / image.width, (row + 0.5) / image.height)
        for row, column in zip(rows[::7].tolist(), columns[::7].tolist(), strict=True)
    }
    assert found <= {chosen, None}
    zoomed = columns > edge
    assert zoomed.sum() > 1000
    middle = columns[zoomed].mean() / image.width, rows[zoomed].mean() / image.height
    assert pixel_at(image, *middle) == chosen


def test_a_pixel_beside_the_one_enlarged_can_be_chosen_and_none_beyond_the_picture():
    figure, zoom = magnified([np.zeros((40, 40), np.uint8)], (20, 10), 3)
    zoom.draw(np.zeros((40, 40), np.uint8))
    image = Image(FigureImage(figure), "bgr8")
    for x, y in [(17, 7), (23, 13), (20, 12)]:
        place = zoom.place(x, y) / [figure.width, figure.height]
        assert pixel_at(image, *place) == (x, y)
    assert pixel_at(image, 244 / figure.width, 0.5) is None, "between the pictures there is nothing"


def test_what_was_chosen_stays_in_the_picture():
    assert PixelParams(-1, 5).pixel((10, 20), (3, 4)) == (3, 4)
    assert PixelParams(7, 5).pixel((10, 20), (3, 4)) == (7, 5)
    assert PixelParams(99, 99).pixel((10, 20), (3, 4)) == (19, 9)
