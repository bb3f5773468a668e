"""The simulated controller itself."""
