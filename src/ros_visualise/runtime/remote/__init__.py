"""Looking at nodes in other processes: who is on the graph, what they publish, how to tune them."""
