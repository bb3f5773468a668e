"""Who speaks to the simulated controller: sockets, ptys, and the process around it."""
