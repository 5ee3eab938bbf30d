"""Playing a source: pause, step, seek, rate and loop, driven by page, command line and ROS alike."""


class Playback:
    """To come with the sources."""
