"""A node that asks for calibrated images is told once where they have no calibration."""

import numpy as np
from waiting import wait_for

from ros_visualise.data import CameraInfo, Header, Image
from ros_visualise.graph import Graph, place
from ros_visualise.nodes import node
from ros_visualise.runtime.local import LocalRuntime


def test_images_without_a_calibration_are_said_once_and_processed_all_the_same(caplog):
    got = []

    @node("focal", inputs={"image": Image}, outputs={"image": Image}, calibrated=True)
    def focal(image, params):
        got.append(image.camera_info)

    runtime = LocalRuntime(Graph(None, (place(focal.declared, {"image": "/image"}),)), None)
    runtime.start()
    info = CameraInfo(2, 2, K=np.eye(3))
    for number, calibration in enumerate((info, None, None)):
        pixels = np.zeros((2, 2), np.uint8)
        image = Image(pixels, "mono8", Header(number), camera_info=calibration)
        runtime.publish("/image", image)
        wait_for(lambda number=number: len(got) == number + 1)
    runtime.stop()
    assert got == [info, None, None]
    said = [r.getMessage() for r in caplog.records if "calibration" in r.getMessage()]
    assert said == ["focal: images on /image have no calibration"]
