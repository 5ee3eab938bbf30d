"""A graph of nodes in this process, joined to the topics of a transport around it."""
