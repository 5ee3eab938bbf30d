"""The source of the measurements of single nodes: publishes a moving picture from memory.

    python source.py VIDEO --rate 30 [--log STAMPS] [--mark] [--lens] [_topic...]

Every image is stamped with the wall time at which it is published; with --mark the stamp is also
written into its first 64 pixels, black or white, for nodes that drop the header.
"""

import argparse
import struct
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import rospy
from sensor_msgs.msg import CameraInfo, Image
from tcpros import MARK_BITS

from ros_visualise.runtime.ros1.topics import Ros1Publisher

_IMAGES = 12


def read(path: Path, count: int = _IMAGES) -> list[np.ndarray]:
    """Some images of a video, there and back so that it goes on for ever without a jump."""
    capture = cv2.VideoCapture(str(path))
    images = []
    while len(images) < count:
        there, image = capture.read()
        if not there:
            break
        images.append(image)
    return images + images[-2:0:-1]


def message(image: np.ndarray) -> Image:
    made = Image()
    made.header.frame_id = "camera_optical"
    made.height, made.width = image.shape[:2]
    made.encoding, made.step = "bgr8", image.shape[1] * 3
    made.data = memoryview(image).cast("B")
    return made


def calibration(height: int, width: int) -> CameraInfo:
    """That of a lens which distorts as many do."""
    x, y = (width - 1) / 2, (height - 1) / 2
    made = CameraInfo(height=height, width=width, distortion_model="plumb_bob")
    made.D = [-0.26, 0.08, 0.004, -0.003, 0.01]
    made.K, made.R = [width, 0, x, 0, width, y, 0, 0, 1], [1, 0, 0, 0, 1, 0, 0, 0, 1]
    made.P = [width, 0, x, 0, 0, width, y, 0, 0, 0, 1, 0]
    return made


def mark(image: np.ndarray, stamp_ns: int) -> None:
    """Write a stamp into the first pixels."""
    bits = (stamp_ns >> np.arange(MARK_BITS, dtype=np.uint64).astype(object)) & 1
    image[0, :MARK_BITS] = bits.astype(np.uint8)[:, None] * 255


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("video", type=Path)
    parser.add_argument("--rate", type=float, required=True)
    parser.add_argument("--log", type=Path, help="to write all stamps to")
    parser.add_argument("--mark", action="store_true")
    parser.add_argument("--lens", action="store_true", help="publish a calibration, too")
    args = parser.parse_args(rospy.myargv()[1:])
    rospy.init_node("source")
    images = read(args.video)
    messages = [message(image) for image in images]
    publisher = Ros1Publisher("image_raw", Image)
    infos = rospy.Publisher("camera_info", CameraInfo, queue_size=1) if args.lens else None
    info = calibration(*images[0].shape[:2])
    log = args.log.open("wb", buffering=0) if args.log else None
    due_s, number = time.monotonic(), 0
    while not rospy.is_shutdown():
        due_s = max(due_s + 1 / args.rate, time.monotonic() - 1 / args.rate)
        time.sleep(max(0.0, due_s - time.monotonic()))
        stamp_ns = time.time_ns()
        chosen = number % len(messages)
        if args.mark:
            mark(images[chosen], stamp_ns)
        messages[chosen].header.stamp = rospy.Time(*divmod(stamp_ns, 10**9))
        if infos:
            info.header = messages[chosen].header
            infos.publish(info)
        publisher.publish(messages[chosen])
        if log:
            log.write(struct.pack("<q", stamp_ns))
        number += 1


if __name__ == "__main__":
    sys.exit(main())
