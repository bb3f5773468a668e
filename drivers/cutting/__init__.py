"""A planned cut: its program, its motion as the controller makes it, and the checks while it runs."""
