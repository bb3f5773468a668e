"""What of the paper needs the lathe: its program executed, and cuts that learn, on the simulated controller."""
