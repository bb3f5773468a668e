"""The Delta Tau PMAC: its language, trajectories and replies. Independent of the simulator."""
