"""A message that ROS 1 cannot hold is refused by one error of ours; the topic goes on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import rospy
from ros_graph import Heard, Master, wait_for

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import Header, Marker, Message, PoseStamped, Text
from ros_visualise.messages.qos import LATCHED
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.ros1.messages import MessagePublisher, advertise, message_class

ORIGIN, UNTURNED = np.zeros(3), np.array([0.0, 0, 0, 1])
BAD = {
    "a number for a text": (Text(7), r"String.data: 7 is not a valid string"),  # type: ignore[arg-type]
    "half a letter": (Text("\ud800"), r"String.data: '\\ud800' is not a valid string"),
    "too large": (Marker(0, id=2**40), r"Marker.id: 1099511627776 is not a valid int32"),
    "a negative stamp": (PoseStamped(ORIGIN, UNTURNED, Header(-5)), "a stamp of -1 s"),
    "no header": (PoseStamped(ORIGIN, UNTURNED, None), "PoseStamped: 'NoneType' object"),  # type: ignore[arg-type]
    "no frame": (
        PoseStamped(ORIGIN, UNTURNED, Header(5, 9)),  # type: ignore[arg-type]
        "PoseStamped.header.frame_id: 9 is not a valid string",
    ),
}


@pytest.fixture
def publisher(ros_master: Master) -> Iterator[Callable[..., MessagePublisher]]:
    """Advertises until the test ends."""
    there: list[Any] = []

    def publisher(topic: str, name: str, **about: Any) -> Any:
        there.append(advertise(topic, TopicType(name, **about)))
        return there[-1]

    yield publisher
    for one in there:
        one.close()


@pytest.mark.parametrize(("message", "why"), BAD.values(), ids=BAD)
@pytest.mark.parametrize("latched", [False, True], ids=["", "latched"])
def test_it_is_refused_and_the_next_one_is_sent(
    message: Message, why: str, latched: bool, publisher: Any, hear: Callable[..., Heard]
) -> None:
    name = message.type_name
    qos = {"qos": LATCHED} if latched else {}
    topic = f"/refused/{name.rpartition('/')[2]}_{'latched' if latched else 'sent'}"
    one = publisher(topic, name, **qos)
    heard = hear(topic, message_class(name))
    wait_for(lambda: one.connections, "the subscriber")
    with pytest.raises(DamagedMessage, match=why):
        one.publish(message)
    good = {"Text": Text("fine"), "Marker": Marker(0, id=3)}
    one.publish(good.get(type(message).__name__, PoseStamped(ORIGIN, UNTURNED, Header(5))))
    wait_for(lambda: heard.messages, "the next one")
    assert len(heard.messages) == 1


def test_what_cannot_be_sent_is_not_kept_for_those_who_come_later(
    publisher: Any, hear: Callable[..., Heard]
) -> None:
    one = publisher("/refused/late", Marker.type_name, qos=LATCHED)
    one.publish(Marker(0, id=1))
    with pytest.raises(DamagedMessage, match="not a valid int32"):
        one.publish(Marker(0, id=2**40))
    heard = hear("/refused/late", message_class(Marker.type_name))
    wait_for(lambda: heard.messages, "what was latched")
    assert [marker.id for marker in heard.messages] == [1]


def test_a_description_that_is_none_does_not_reach_the_parameter_server(publisher: Any) -> None:

    one = publisher("/refused/description", Text.type_name, qos=LATCHED)
    with pytest.raises(DamagedMessage):
        one.publish(Text(7))
    assert not rospy.has_param("/refused/description")
    one.publish(Text("<robot/>"))
    assert rospy.get_param("/refused/description") == "<robot/>"
