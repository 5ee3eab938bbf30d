"""What publishers offer and subscribers ask for: the best that all of them allow."""

import itertools
from types import SimpleNamespace

import pytest

from ros_visualise.messages.qos import QoS
from ros_visualise.runtime.ros2.quality import clash, fitting, profile

ALL = [QoS(7, reliable, local) for reliable in (True, False) for local in (True, False)]


def end(node: str, qos: QoS) -> SimpleNamespace:
    return SimpleNamespace(node_name=node, node_namespace="/robot", qos_profile=profile(qos))


@pytest.mark.parametrize("offered", list(itertools.combinations_with_replacement(ALL, 2)), ids=str)
def test_what_fits_all_publishers_gets_messages_from_each(offered: tuple[QoS, ...]):
    asked = fitting([profile(one) for one in offered], 3)
    assert asked.depth == 3
    assert [clash(end("a", one), end("b", asked)) for one in offered] == [None, None]
    assert asked.reliable == all(one.reliable for one in offered)
    assert asked.transient_local == all(one.transient_local for one in offered)


def test_both_sides_are_named_where_no_messages_pass():
    camera = end("camera", QoS(reliable=False))
    why = clash(camera, end("recorder", QoS(reliable=True)))
    assert why == "/robot/recorder requests reliable, but /robot/camera offers best effort"
    why = clash(camera, end("map", QoS(reliable=False, transient_local=True)))
    assert why == "/robot/map requests transient local, but /robot/camera offers volatile"
