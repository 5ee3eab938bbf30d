"""What runs a graph of nodes. Runtimes are peers: the same nodes run unchanged in each."""
