"""A page of your own graph: a source of your own, with its edges. Open the printed address

python examples/21_own_page.py 8080
"""

import sys
from contextlib import suppress
from pathlib import Path

from ros_visualise.graph.pipelines import alone
from ros_visualise.nodes import find, find_node
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback
from ros_visualise.ui import ViewOptions, open_view

BALL = f"{Path(__file__).parent / '05_own_source.py'}:Ball"

graph = alone(find(BALL)).insert(find_node("edge_detector"), after="ball")
runtime = LocalRuntime(graph, Playback())
view = open_view("web", ViewOptions(port=int(sys.argv[1])))
with suppress(KeyboardInterrupt):
    view.open(runtime)
    runtime.start()
    while not view.closed:
        view.spin(0.1)
view.close()
runtime.stop()
