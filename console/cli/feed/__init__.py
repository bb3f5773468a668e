"""The commands that read the state feed of running consoles."""
