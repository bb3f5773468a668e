"""What carries bytes between the console and a controller."""
