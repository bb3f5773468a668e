"""Page Train, and what it shows."""
