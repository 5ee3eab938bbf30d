"""Object detection networks: ONNX files, run by onnxruntime.

`network.Network` opens a file, recognises the layout of its outputs (`layouts`), and detects
objects in images. The other modules are its steps: `session` runs a file, `preparation` turns an
image into the network's input, `names` are those of the classes, `candidates` are what a layout
decodes from the outputs, and the selection among them.
"""
