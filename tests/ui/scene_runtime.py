"""A runtime whose topics a test publishes on, and which tells what is asked for and sent."""

from collections import Counter
from functools import partial
from typing import ClassVar

from ros_visualise.core.params import Parameters
from ros_visualise.graph import Graph, Node
from ros_visualise.nodes import NodeType, NoParams
from ros_visualise.runtime.queues import Inbox, Packet
from ros_visualise.runtime.report import NodeReport, RunReport, TopicReport
from ros_visualise.runtime.topics import Subscription, Topic


class Told:
    """One node that publishes topics of these types, and takes those of ``inputs``."""

    name = ""
    diagnostic_topics: ClassVar = {}
    playback = None
    publishes = False

    def __init__(self, inputs=None, **kinds):
        inputs = inputs or {}
        outputs = {f"/{name}": kind for name, kind in kinds.items()}
        declared = NodeType("robot", None, NoParams, inputs, outputs)
        node = Node(
            "robot",
            declared,
            NoParams(),
            {name: f"/{name}" for name in inputs},
            {name: name for name in outputs},
        )
        self.graph = Graph(None, (node,))
        self.parameters = {"robot": Parameters(NoParams())}
        self.asked = Counter()
        self.taken = []
        topics = [*outputs, *node.inputs.values()]
        self._topics = {name: Topic(name) for name in topics}
        self._number = self.epoch = 0

    def add(self, topic, kind):
        """One more topic, beside the graph's."""
        self.diagnostic_topics = {**self.diagnostic_topics, topic: kind}
        self._topics[topic] = Topic(topic)

    def say(self, **messages):
        """Publish one message on each of these topics."""
        for name, message in messages.items():
            self._number += 1
            self._topics[f"/{name}"].publish(Packet(self._number, message, 0, epoch=self.epoch))

    def publish(self, topic, message):
        self.taken.append((topic, message))

    def subscribe(self, topic, depth=1):
        inbox = Inbox(lossless=False, keep=depth)
        self._topics[topic].connect(inbox, latched=True)
        self.asked[topic] += 1
        return Subscription(topic, inbox, partial(self._end, topic, inbox))

    def report(self, window_s=None):
        topics = dict.fromkeys(self.graph.topics, TopicReport("", 0, None, None))
        return RunReport(topics, {"robot": NodeReport()})

    def _end(self, topic, inbox):
        self._topics[topic].disconnect(inbox)
        self.asked[topic] -= 1
