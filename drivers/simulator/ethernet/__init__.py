"""The Ethernet board of the simulated card."""
