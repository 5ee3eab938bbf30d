"""Networks that find things in images: ONNX files, run by onnxruntime.

`network.Network` opens a file, recognises in which of the ways of `layouts` it answers, and finds
things in images. All else is one step of that each: `session` runs a file, `preparation` turns an
image into what a network takes, `names` are those of the classes, `candidates` are what a layout
reads from the outputs, and the choice among them.
"""
