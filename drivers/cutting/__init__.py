"""A planned cut: its program, its motion as the controller makes it, and what is checked while it runs."""
