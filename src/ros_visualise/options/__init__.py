"""What can be asked of the commands. Light to import."""
