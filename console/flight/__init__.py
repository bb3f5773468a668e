"""The flight recorder: the last minutes of a console on disk, and their reading for a replay."""
