"""A graph of nodes in this process, connected to the topics of a transport."""
