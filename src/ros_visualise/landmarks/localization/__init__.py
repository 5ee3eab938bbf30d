"""Where landmarks are: detections of many images put together, with honest uncertainty."""
