"""Parts of the paper that need the lathe: its program executed, and cuts that learn, on the simulator."""
