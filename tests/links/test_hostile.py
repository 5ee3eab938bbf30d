"""Every message of the dialect with wild values, at both ends of a line."""

import logging
import math
import random

import pytest
from links_ends import Flyer, Station, free_port, udp_line
from pymavlink.dialects.v20 import ardupilotmega as v2
from waiting import wait_for

from ros_visualise.data import Header, NavSatFix
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.nodes.autopilot import AutopilotLink, AutopilotParams
from ros_visualise.nodes.mavlink_vehicle import MavlinkVehicle, MavlinkVehicleParams

FLOATS = (0.0, 1.0, -1.0, 0.5, 400.0, math.nan, math.inf, -math.inf, 1e30, -3e38)
COMMANDS = (20, 21, 22, 176, 178, 192, 400, 410, 511, 512, 520)
TO_VEHICLES = (
    *("COMMAND_LONG", "COMMAND_INT", "SET_POSITION_TARGET_LOCAL_NED", "LANDING_TARGET", "SET_MODE"),
    *("SET_POSITION_TARGET_GLOBAL_INT", "PARAM_SET", "PARAM_REQUEST_READ", "MISSION_COUNT"),
)
KINDS = list(v2.mavlink_map.values())


def wild(kind, dice):
    """A message of a kind; addressed to all or to system 1."""
    sizes = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))

    def value(name, type_name):
        if name in ("target_system", "target_component"):
            return dice.choice((0, 1))
        if name == "command":
            return dice.choice(COMMANDS)
        if type_name in ("float", "double"):
            return dice.choice(FLOATS)
        if type_name == "char":
            return bytes([dice.randrange(256)])
        bits = int("".join(filter(str.isdigit, type_name)).removesuffix("2") or 8)
        low, high = (
            (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if type_name[0] == "i" else (0, 2**bits - 1)
        )
        return dice.choice((0, 1, 3, 8, low, high, dice.randint(low, high)))

    values = []
    for name, type_name in zip(kind.fieldnames, kind.fieldtypes, strict=True):
        several = [value(name, type_name) for _ in range(sizes[name] or 1)]
        is_text = type_name == "char" and sizes[name]
        values.append(b"".join(several) if is_text else several if sizes[name] else several[0])
    return kind(*values)


@pytest.mark.parametrize("seed", [0, 1])
def test_wild_messages_end_nothing(seed, caplog):
    dice, station, port = random.Random(seed), Station(), free_port()
    params = MavlinkVehicleParams(address=f"udpout://127.0.0.1:{station.port}")
    flyer = Flyer(MavlinkVehicle.declared.make(params), params)
    fix = NavSatFix(49.0, 8.4, 116.0, header=Header(0))
    flyer.node.step(params, fix=fix, frames=FrameTree())
    own = AutopilotParams(address=f"udp://:{port}")
    link = AutopilotLink.declared.make(own)
    station.wait("HEARTBEAT")
    station.hush()
    mav, line = v2.MAVLink(None, 1, 1), udp_line(port)
    line.send(v2.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3).pack(mav))
    for _ in range(40):
        for kind in dice.sample(KINDS, 10):
            line.send(wild(kind, dice).pack(mav))
        for name in dice.sample(TO_VEHICLES, 5):
            station.send(wild(next(k for k in KINDS if k.msgname == name), dice))
        flyer.fly(0.1)
        while link.tick(own) is not None:
            pass
    assert station.command(510) == 3  # it still answers
    line.send(v2.MAVLink_statustext_message(6, b"still here").pack(mav))

    def heard():
        answer = link.tick(own) or {}
        return "text" in answer and answer["text"].text == "still here"

    wait_for(heard, "text")
    assert not [one for one in caplog.records if one.levelno >= logging.ERROR]
    for end in (line, station):
        end.close()
    link.finish()
    flyer.node.finish()
