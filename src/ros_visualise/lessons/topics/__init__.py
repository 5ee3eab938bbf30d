"""The lessons, one in each file: its text, and a node for each step."""
