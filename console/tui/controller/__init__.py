"""The page Controller: its views as lines, and what it does beside the screen."""
