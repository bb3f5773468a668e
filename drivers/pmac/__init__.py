"""The Delta Tau PMAC: its language, its trajectories, its replies. Knows no simulator."""
