"""Where data is recorded to."""
