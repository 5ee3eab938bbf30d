"""The 3D scene: messages in one fixed frame, each kind drawn by a module of its own.

Everything stands below one node of the page's scene, so that the world can move under the cameras
of all browsers (`view`). A message is placed by the transform at its own stamp (`frames`).
"""
