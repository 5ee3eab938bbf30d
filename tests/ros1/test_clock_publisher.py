"""A clock goes on after a time that ROS cannot hold."""

from contextlib import closing

from ros_graph import wait_for
from rosgraph_msgs.msg import Clock

from ros_visualise.core.supervision import PROCESS
from ros_visualise.runtime.bridge.clock import ClockPublisher
from ros_visualise.runtime.ros1.transport import Ros1Transport

BEYOND_NS = 2**32 * 10**9


def test_a_time_that_cannot_be_told_is_counted_and_the_next_one_told(hear):
    now = [BEYOND_NS]
    heard = hear("/clock", Clock)
    with closing(ClockPublisher(Ros1Transport(), lambda: now[0])):
        wait_for(lambda: PROCESS.failures, "the failure")
        now[0] = 7 * 10**9
        [clock, *_] = heard.wait()
    assert clock.clock.secs == 7
    assert {failure.who for failure in PROCESS.failures} == {"clock"}
    PROCESS.forget()
