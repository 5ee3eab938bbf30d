"""The 3D view: a tree of nodes, drawn by all browsers that show it."""
