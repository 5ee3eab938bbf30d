"""What commands share: groups of options, playing, and work that Ctrl-C need not wait for."""
