"""Topics that come and go leave no open file behind."""

import gc
import os

import rospy
from std_msgs.msg import String

from ros_visualise.runtime.ros1.repairs import mend_pollers


def open_files():
    return len(os.listdir("/proc/self/fd"))


def come_and_go(number):
    rospy.Subscriber(f"/heard_{number}", String).unregister()
    rospy.Publisher(f"/said_{number}", String, queue_size=1).unregister()


def test_topics_that_are_left_leave_no_open_file(ros_master):
    mend_pollers()
    come_and_go(0)
    before = open_files()
    gc.disable()
    try:
        for number in range(20):
            come_and_go(number)
        assert open_files() < before + 5
    finally:
        gc.enable()
