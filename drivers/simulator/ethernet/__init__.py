"""The Ethernet board of the simulated controller."""
