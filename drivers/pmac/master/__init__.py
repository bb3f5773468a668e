"""Being led by a master encoder: its position as the card converts it, external time base, following."""
