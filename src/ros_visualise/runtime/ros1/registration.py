"""This node's registration with the ROS master: made by rospy, and kept up here.

A node goes on without its master, as every node of ROS does: those who are connected stay so.
Those of rospy are lost to a master that starts anew; this one registers with it again.
"""

from __future__ import annotations

import errno
import http.client
import logging
import time
import xmlrpc.client
from collections.abc import Callable
from functools import partial
from typing import Any

import rosgraph
import rospy
from rospy.impl.registration import (
    Registration,
    RegistrationListener,
    RegManager,
    get_registration_listeners,
    get_service_manager,
    get_topic_manager,
)

from ros_visualise.core import supervision
from ros_visualise.core.errors import Unreachable, UsageError
from ros_visualise.core.printing import print_status
from ros_visualise.runtime.ros1.errors import MASTER, translated

log = logging.getLogger(__name__)

_CHECK_S = 0.5
_PATIENCE_S = 2.0
_LESS_PATIENCE_S = 0.3  # with a master that has not answered before
_params: dict[str, Any] = {}


def wait_for_master() -> None:
    """Wait until there is a ROS master, and from then on for none of its answers for ever.

    Raises:
        UsageError: its address is not a valid one.
    """
    try:
        uri, is_online = rosgraph.get_master_uri(), rosgraph.is_master_online()
    except ValueError as error:
        raise UsageError(f"{error}; set ROS_MASTER_URI=http://HOST:11311") from None
    if not is_online:
        print_status(f"no ROS master at {uri} yet, waiting; start one with: roscore")
    while not rosgraph.is_master_online():
        time.sleep(_CHECK_S)
    rospy.core._xmlrpc_cache[uri] = rospy.core._LockedServerProxy(uri, transport=BoundedTransport())


def set_param(name: str, value: Any) -> None:
    """Set a parameter; without a master, as soon as there is one."""
    _params[name] = value
    try:
        with translated(MASTER):
            rospy.set_param(name, value)
    except Unreachable as error:
        log.debug("%s", error)


def keep_registered(on_gone: Callable[[], None]) -> None:
    """Register what this node has and will have with whatever master there is.

    Args:
        on_gone: called each time that the master is lost.
    """
    listeners = get_registration_listeners()
    with listeners.lock:
        [manager] = [one for one in listeners.listeners if isinstance(one, RegManager)]
        registrar = _Registrar(manager)
        listeners.listeners[:] = [registrar]
    rospy.core.add_shutdown_hook(lambda _: registrar.wake())
    supervision.start("master watch", partial(registrar.watch, on_gone), again_s=_CHECK_S)


class _Registrar(RegistrationListener):  # type: ignore[misc]
    """Takes the place of rospy's own, which asks a lost master until it answers.

    It does so with a lock that the end of the process needs, too.
    """

    def __init__(self, manager: RegManager) -> None:
        self._manager = manager
        self._name = rospy.get_name()
        self._master = rospy.core.xmlrpcapi(manager.master_uri)
        self._known = self._missed = 0  # the master's process, and calls without an answer since

    def reg_added(self, name: str, kind: str, direction: str) -> None:
        """A topic or service is there; with a type or an address."""
        try:
            with translated(MASTER):
                self._register(name, kind, direction)
        except Unreachable as error:
            log.debug("%s will be registered when the master is back: %s", name, error)

    def reg_removed(self, name: str, kind: str, direction: str) -> None:
        """A topic or service is there no longer."""
        leave = {
            Registration.PUB: ("unregisterPublisher", self._manager.uri),
            Registration.SUB: ("unregisterSubscriber", self._manager.uri),
            Registration.SRV: ("unregisterService", kind),
        }
        method, address = leave[direction]
        try:
            with translated(MASTER):
                getattr(self._master, method)(self._name, name, address)
        except Unreachable as error:
            log.debug("cannot unregister %s: %s", name, error)

    def wake(self) -> None:
        """Wake the manager, which else looks after half a second, as the process ends."""
        with self._manager.cond:
            self._manager.cond.notify_all()

    def watch(self, on_gone: Callable[[], None]) -> None:
        """Notice that the master is lost, and register with the next one; until the end."""
        while not rospy.is_shutdown():
            try:
                with translated(MASTER):
                    self._look()
            except Unreachable:
                self._missed += 1
                if self._missed == 2:  # a single call may fail on a busy network
                    on_gone()
            time.sleep(_CHECK_S)

    def _look(self) -> None:
        _, _, pid = self._master.getPid(self._name)
        if self._known and (self._missed or pid != self._known):
            self._register_all()
        self._known, self._missed = pid, 0

    def _register_all(self) -> None:
        topics, services = get_topic_manager(), get_service_manager()
        there = [
            *((*topic, Registration.PUB) for topic in topics.get_publications()),
            *((*topic, Registration.SUB) for topic in topics.get_subscriptions()),
            *((*service, Registration.SRV) for service in services.get_services()),
        ]
        for one in there:
            self._register(*one)
        for name, value in list(_params.items()):
            rospy.set_param(name, value)
        log.warning("the ROS master is back; registered with it again")

    def _register(self, name: str, kind: str, direction: str) -> None:
        own = self._manager.uri
        if direction == Registration.PUB:
            answer = self._master.registerPublisher(self._name, name, kind, own)
        elif direction == Registration.SUB:
            answer = self._master.registerSubscriber(self._name, name, kind, own)
        else:
            answer = self._master.registerService(self._name, name, kind, own)
        code, message, publishers = answer
        if code != 1:
            log.error("the ROS master rejects %s: %s", name, message)
        elif direction == Registration.SUB:
            self._manager.publisher_update(name, _addresses(publishers))


def _addresses(publishers: Any) -> list[str]:
    """Those of the publishers of a topic, as a master lists them.

    rospy's own thread, which connects to them, would end by anything else.

    Raises:
        TypeError: it is no list of texts.
    """
    if not isinstance(publishers, list) or not all(isinstance(one, str) for one in publishers):
        raise TypeError(f"{publishers!r} is not a list of publishers")
    return publishers


class BoundedTransport(xmlrpc.client.Transport):
    """Does not wait for ever for an answer, as when the other machine was switched off."""

    _patience_s = _PATIENCE_S

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = self._patience_s
        return connection

    def single_request(self, *args: Any) -> Any:
        try:
            answer = super().single_request(*args)
        except TimeoutError as error:  # rospy wants a number in it
            self._patience_s = _LESS_PATIENCE_S
            raise OSError(errno.ETIMEDOUT, "the ROS master does not answer") from error
        self._patience_s = _PATIENCE_S
        return answer
