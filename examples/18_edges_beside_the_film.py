"""A whole pipeline without loss, written as a film: each frame beside its edges.

python examples/18_edges_beside_the_film.py flight.mp4 beside.avi
"""

import sys

import cv2

import ros_visualise as rv

if len(sys.argv) != 3:
    sys.exit(__doc__)
source, target = sys.argv[1:]
graph = rv.pipeline(source).configured({"filters": {"gray": True, "blur": "gaussian"}})
film, frame = None, None
for sample in rv.run(graph, ["/controlled_stream", "/edges"], kind=rv.Image):
    if sample.topic == "/controlled_stream":
        frame = sample.message.pixels
        continue
    edges = cv2.cvtColor(sample.message.pixels, cv2.COLOR_GRAY2BGR)
    both = cv2.hconcat([frame, edges])
    if film is None:
        codec = cv2.VideoWriter.fourcc(*"MJPG")
        film = cv2.VideoWriter(target, codec, 30, (both.shape[1], both.shape[0]))
    film.write(both)
if film is not None:
    film.release()
