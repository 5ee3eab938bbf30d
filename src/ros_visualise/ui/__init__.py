"""What a person sees and moves: the page, the windows."""
