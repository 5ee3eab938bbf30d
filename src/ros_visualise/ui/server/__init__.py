"""The web server of the page: one port, one gate, one event loop."""
