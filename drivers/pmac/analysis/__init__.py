"""What a motion program will really do: its motion move by move, and what is wrong with it."""
