"""A plain, well written rospy node, as a user would write it: gray, then Canny."""

import cv2
import numpy as np
import rospy
from sensor_msgs.msg import Image


def main() -> None:
    rospy.init_node("rospy_canny")
    low, high = rospy.get_param("~low", 200), rospy.get_param("~high", 300)
    publisher = rospy.Publisher("edges", Image, queue_size=1)

    def step(message: Image) -> None:
        bgr = np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, 3)
        edges = cv2.Canny(cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY), low, high)
        answer = Image()
        answer.header = message.header
        answer.height, answer.width = edges.shape
        answer.encoding, answer.step = "mono8", message.width
        answer.data = edges.tobytes()
        publisher.publish(answer)

    # a receive buffer that holds an image, so that queue_size=1 drops the old ones
    rospy.Subscriber("image_raw", Image, step, queue_size=1, buff_size=1 << 25)
    rospy.spin()


if __name__ == "__main__":
    main()
