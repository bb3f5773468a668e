"""Training on the simulated lathe: lessons, and how far a try has come."""
