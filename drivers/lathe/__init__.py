"""The machine as the console sees it: axes by name, in mm, degrees and rpm."""
