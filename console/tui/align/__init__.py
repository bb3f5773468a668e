"""What the page Align knows of jogging: presses of a key, steps that wait, limits, targets."""
