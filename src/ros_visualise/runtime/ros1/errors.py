"""Errors of ROS 1's libraries as errors of ours: the one place where they are translated."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from http.client import HTTPException
from typing import Any
from xml.parsers.expat import ExpatError
from xmlrpc.client import Error as XmlRpcError

import rosgraph
import rospkg
import rospy

from ros_visualise.core.errors import DamagedMessage, OpenError, RosVisualiseError, Unreachable
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.misfits import refused

MASTER = "the ROS master"

UNANSWERED = (
    OSError,
    HTTPException,
    XmlRpcError,
    ExpatError,  # an answer that was cut off
    ValueError,  # one that is not what it says to be
    TypeError,  # one without the three values that each answer has
    rosgraph.MasterException,
    rospy.ServiceException,
    rospy.ROSException,
)
"""Raised for masters, nodes and services that do not answer, or not in words of XML-RPC."""

_REFUSED = "responded with an error"  # rospy has one exception for this and for no answer at all


@contextmanager
def translated(asked: str) -> Iterator[None]:
    """Call the libraries within this, or decorate a function with it.

    Args:
        asked: the node, service or file that is asked for.

    Raises:
        OpenError: a package is missing.
        Unreachable: no answer came, or none that can be understood.
        RosVisualiseError: the answer is an error.
    """
    try:
        yield
    except RosVisualiseError:  # one may be a ValueError as well
        raise
    except rospkg.ResourceNotFound as error:
        package = error.args[0]
        raise OpenError(f"{asked}: no package {package!r}; try: rospack find {package}") from None
    except UNANSWERED as error:
        if isinstance(error, rospy.ServiceException) and _REFUSED in str(error):
            raise RosVisualiseError(str(error)) from error
        raise Unreachable(f"{asked} does not answer: {error}") from error


@contextmanager
def sending(message: Any, definitions: Definitions) -> Iterator[None]:
    """Make and send a message within this: its fields may hold anything.

    Raises:
        DamagedMessage: ROS 1 cannot hold it.
    """
    try:
        yield
    except DamagedMessage:
        raise
    except Exception as error:  # genpy raises what it happens to meet
        raise refused(message, error, definitions.store) from error
