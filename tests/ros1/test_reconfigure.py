"""A node's parameters over dynamic_reconfigure, with dynparam and plain ROS as clients."""

import ast
import logging
import math
import subprocess
import threading
import time
from dataclasses import asdict, dataclass
from enum import Enum

import pytest
import rospy
from dynamic_reconfigure.msg import (
    BoolParameter,
    Config,
    ConfigDescription,
    DoubleParameter,
    IntParameter,
    StrParameter,
)
from dynamic_reconfigure.srv import Reconfigure
from ros_graph import wait_for

from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import Parameters, param, specs
from ros_visualise.nodes import find
from ros_visualise.runtime.ros1.reconfigure_server import (
    ReconfigureServer,
    describe,
    starting_values,
)

pytestmark = [
    pytest.mark.usefixtures("ros_master"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),  # rospy leaves sockets to the collector
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.filterwarnings("ignore:notifyAll:DeprecationWarning"),  # rospy's threads
]


DYNPARAM = ("/usr/bin/python3", "/usr/lib/dynamic_reconfigure/dynparam")


class Blur(Enum):
    OFF = "off"
    BOX = "box"
    THREE = 3


@dataclass(frozen=True)
class Every:
    count: int = param(5, "a count", min=0, max=800, slider=(0, 30))
    free: int = param(7, "no upper limit", min=1)
    ratio: float = param(1, "a ratio", min=0, max=20)
    open: float = param(2.5, "no limits", group="more")
    lit: bool = param(True, "a switch", group="more")
    name: str = param("x", "a text", restart=True)
    blur: Blur = param(Blur.BOX, "a choice", group="other")


@pytest.fixture
def parameters():
    return Parameters(Every())


@pytest.fixture
def server(parameters):
    offered = ReconfigureServer(parameters, "own")
    yield rospy.get_name() + "/own"
    offered.close()


def dynparam(*arguments):
    done = subprocess.run([*DYNPARAM, *arguments], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout


def dynparam_get(node):
    """What dynparam prints of a node, without the groups."""
    printed = ast.literal_eval(dynparam("get", node))
    return {name: value for name, value in printed.items() if name != "groups"}


def as_ros(params):
    return {n: str(v.value) if isinstance(v, Enum) else v for n, v in asdict(params).items()}


def latched(node, topic, message_class):
    return rospy.wait_for_message(f"{node}/{topic}", message_class, 60)


def values_in(config):
    return {p.name: p.value for p in config.bools + config.ints + config.strs + config.doubles}


def set_over_ros(node, **kinds):
    """Set by the service, in whichever types are given; the values that it answers with."""
    service = rospy.ServiceProxy(f"{node}/set_parameters", Reconfigure)
    return values_in(service(Config(**kinds)).config)


def test_dynparam_gets_what_holds(server, parameters):
    assert dynparam_get(server) == as_ros(parameters.current)


def test_dynparam_sets_every_type_as_one_whole(server, parameters):
    told = []
    parameters.on_change(lambda current, changed: told.append(dict(changed)))
    dynparam("set", server, "{count: 30, ratio: 3, lit: false, name: 12, blur: off, free: 900}")
    expected = {
        "count": 30,
        "ratio": 3.0,
        "lit": False,
        "name": "12",
        "blur": Blur.OFF,
        "free": 900,
    }
    assert told == [expected]
    assert isinstance(parameters.current.ratio, float)
    assert dynparam_get(server) == as_ros(parameters.current)


@pytest.mark.parametrize("text", ["3", "off", "Box"])
def test_dynparam_sets_a_choice_by_its_text(server, parameters, text):
    dynparam("set", server, "blur", text)
    assert str(parameters.current.blur.value) == text.lower()


def test_dynparam_lists_it(server):
    assert server in dynparam("list").splitlines()


def test_dynparam_loads_what_it_dumped(server, parameters, tmp_path):
    parameters.update({"count": 11, "blur": "off"})
    wait_for(lambda: rospy.get_param(f"{server}/blur") == "off")
    dynparam("dump", server, str(tmp_path / "kept.yaml"))
    kept = parameters.current
    parameters.update(vars(Every()))
    dynparam("load", server, str(tmp_path / "kept.yaml"))
    assert parameters.current == kept


def test_the_description_tells_types_ranges_help_and_levels(server):
    told = latched(server, "parameter_descriptions", ConfigDescription)
    low, high, default = (values_in(config) for config in (told.min, told.max, told.dflt))
    assert (low["count"], high["count"], default["count"]) == (0, 800, 5)
    assert (low["free"], high["free"]) == (1, 2**31 - 1)
    assert (low["open"], high["open"]) == (-float("inf"), float("inf"))
    assert (low["lit"], high["lit"], low["blur"], high["name"]) == (False, True, "", "")
    assert [p.name for p in told.dflt.doubles] == ["ratio", "open"]
    one = {p.name: p for group in told.groups for p in group.parameters}
    types = {name: described.type for name, described in one.items()}
    assert types == {"count": "int", "free": "int", "ratio": "double", "open": "double"} | {
        "lit": "bool",
        "name": "str",
        "blur": "str",
    }
    assert one["count"].description == "a count"
    assert [name for name, described in one.items() if described.level] == ["name"]
    choices = ast.literal_eval(one["blur"].edit_method)
    assert [choice["value"] for choice in choices["enum"]] == ["off", "box", "3"]
    assert one["count"].edit_method == ""


def test_the_description_keeps_the_groups(server):
    told = latched(server, "parameter_descriptions", ConfigDescription)
    groups = {group.name: [p.name for p in group.parameters] for group in told.groups}
    assert groups == {
        "Default": ["count", "free", "ratio", "name"],
        "more": ["open", "lit"],
        "other": ["blur"],
    }
    assert len({group.id for group in told.groups}) == 3
    updates = latched(server, "parameter_updates", Config)
    assert [(g.name, g.id) for g in updates.groups] == [(g.name, g.id) for g in told.groups]


def test_a_change_from_elsewhere_is_published_and_put_on_the_parameter_server(server, parameters):
    seen = []
    subscriber = rospy.Subscriber(f"{server}/parameter_updates", Config, seen.append)
    wait_for(lambda: seen)
    parameters.update({"count": 77, "blur": Blur.THREE})
    wait_for(lambda: values_in(seen[-1])["count"] == 77)
    subscriber.unregister()
    assert values_in(seen[-1]) == as_ros(parameters.current)
    assert rospy.get_param(server) == as_ros(parameters.current)


@pytest.mark.parametrize(
    ("given", "allowed"),
    [
        ({"strs": [StrParameter("blur", "heavy")]}, "off, box, 3"),
        ({"doubles": [DoubleParameter("count", 1.5)]}, "a whole number"),
        ({"bools": [BoolParameter("count", True)]}, "a whole number"),
        ({"doubles": [DoubleParameter("open", float("nan"))]}, "open=nan: must be"),
        ({"ints": [IntParameter("cuont", 3)]}, "did you mean count"),
    ],
)
def test_what_is_refused_leaves_everything_and_is_said_once(
    server, parameters, caplog, given, allowed
):
    before = parameters.current
    given = {"ints": [], **given}
    given["ints"] = [*given["ints"], IntParameter("free", 99)]
    with pytest.raises(rospy.ServiceException, match=allowed):
        set_over_ros(server, **given)
    assert parameters.current is before
    ours = [r for r in caplog.records if r.name.startswith("ros_visualise")]
    warnings = [r.getMessage() for r in ours if r.levelno >= logging.WARNING]
    assert len(warnings) == 1
    assert allowed in warnings[0]
    assert rospy.get_param(f"{server}/free") == 7


def test_dynparam_ends_with_what_is_refused_and_why(server, parameters):
    command = [*DYNPARAM, "set", server, "{blur: heavy, free: 99}"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode != 0
    assert "blur=heavy: choose one of off, box, 3" in done.stderr
    assert parameters.current == Every()


def test_what_is_out_of_range_becomes_the_limit_as_with_other_servers(server, parameters, caplog):
    told = set_over_ros(
        server,
        ints=[IntParameter("count", 900), IntParameter("free", 0)],
        doubles=[DoubleParameter("ratio", -math.inf), DoubleParameter("open", 1e9)],
    )
    assert (told["count"], told["free"], told["ratio"], told["open"]) == (800, 1, 0, 1e9)
    assert type(parameters.current.count) is int
    said = [one for one in caplog.messages if "out of range" in one]
    assert len(said) == 3
    assert "count=900 out of range; limited to 800" in said[0]


def test_types_are_coerced_as_declared(server, parameters):
    told = set_over_ros(
        server, ints=[IntParameter("ratio", 2)], doubles=[DoubleParameter("count", 30.0)]
    )
    assert (told["ratio"], told["count"]) == (2.0, 30)
    assert type(parameters.current.count) is int
    assert type(parameters.current.ratio) is float


def test_both_sides_at_once_end_in_step_and_in_peace(server, parameters):
    seen = []
    subscriber = rospy.Subscriber(f"{server}/parameter_updates", Config, seen.append)
    wait_for(lambda: seen)

    def from_here():
        for count in range(200):
            parameters.update({"count": count})

    def from_there():
        for free in range(1, 60):
            set_over_ros(server, ints=[IntParameter("free", free)])

    threads = [threading.Thread(target=work) for work in (from_here, from_there, from_there)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
        assert not thread.is_alive()
    assert parameters.current.count == 199
    assert parameters.current.free == 59
    wait_for(lambda: values_in(seen[-1]) == as_ros(parameters.current))
    wait_for(lambda: is_quiet(seen), "an end of the echoes")
    subscriber.unregister()
    assert rospy.get_param(server) == as_ros(parameters.current)


def is_quiet(seen):
    count = len(seen)
    time.sleep(0.3)
    return len(seen) == count


def test_an_int_beyond_32_bits_is_told_as_far_as_ros_can(server, parameters):
    parameters.update({"free": 3_000_000_000})
    wait_for(lambda: rospy.get_param(f"{server}/free") == 2**31 - 1)
    assert parameters.current.free == 3_000_000_000


def test_after_close_nothing_is_offered(parameters):
    offered = ReconfigureServer(parameters, "gone")
    name = rospy.get_name() + "/gone"
    offered.close()
    offered.close()
    parameters.update({"count": 3})
    with pytest.raises(rospy.ServiceException):
        set_over_ros(name, ints=[IntParameter("free", 9)])
    assert f"{name}/parameter_updates" not in dict(rospy.get_published_topics())
    assert parameters.current.free == 7


@pytest.mark.parametrize("name", ["filters", "edge_detector", "fps_control", "streamer", "camera"])
def test_our_nodes_can_be_described(name):
    declared = specs(find(name).params)
    groups = describe(declared).groups
    told = [p.name for group in groups for p in group.parameters]
    assert sorted(told) == sorted(spec.name for spec in declared)


@pytest.fixture
def given():
    """Sets private parameters under ``start``, as a launch file does."""
    base = rospy.get_name() + "/start"

    def give(**values):
        rospy.set_param(base, values)

    yield give
    if rospy.has_param(base):
        rospy.delete_param(base)


def test_starting_values_are_read_in_their_own_types(given):
    given(count=3, ratio=2, blur=False, name=12)
    read = starting_values(Every, "start")
    assert read == {"count": 3, "ratio": 2.0, "blur": Blur.OFF, "name": "12"}
    assert type(read["ratio"]) is float


def test_nothing_given_is_no_change():
    assert starting_values(Every, "nothing_there") == {}


@pytest.mark.parametrize(
    "wrong", [{"count": 900}, {"ratio": "fast"}, {"blur": "heavy"}, {"name": ["a"]}, {"lit": 7}]
)
def test_a_wrong_starting_value_is_named(given, wrong):
    given(**wrong)
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        starting_values(Every, "start")


def test_an_undeclared_private_parameter_is_warned_of_once(given, caplog):
    given(cuont=3, view="none", count=4)
    assert starting_values(Every, "start", known=("view",)) == {"count": 4}
    [warning] = [record.getMessage() for record in caplog.records]
    assert "~start/cuont" in warning
    assert "count, free, ratio" in warning
