"""What ROS 1's libraries raise where somebody is asked over the network, as errors of ours."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from http.client import HTTPException
from xml.parsers.expat import ExpatError
from xmlrpc.client import Error as XmlRpcError

import rosgraph
import rospy

from ros_visualise.core.errors import RosVisualiseError, Unreachable

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
"""What master, nodes and services raise that do not answer, or not in words of XML-RPC."""

_REFUSED = "responded with an error"  # rospy has one exception for this and for no answer at all


@contextmanager
def asking(whom: str) -> Iterator[None]:
    """Within this somebody is asked; what the libraries raise becomes ours.

    Raises:
        Unreachable: no answer came, or none that can be understood.
        RosVisualiseError: the answer is an error.
    """
    try:
        yield
    except RosVisualiseError:  # one may be a ValueError as well
        raise
    except UNANSWERED as error:
        if isinstance(error, rospy.ServiceException) and _REFUSED in str(error):
            raise RosVisualiseError(str(error)) from error
        raise Unreachable(f"{whom} does not answer: {error}") from error
