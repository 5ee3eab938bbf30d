"""A graph of nodes in this process, joined to the topics of a middleware around it."""
