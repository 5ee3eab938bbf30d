"""What the commands do: a module for each, with ``run(args)`` that returns the exit status."""
