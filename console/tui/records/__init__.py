"""What the page Records shows: read beside the screen, and laid out as lines and plots."""
