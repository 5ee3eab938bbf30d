"""Live images and the clock of the page, over WebSockets of our own."""
