"""Host interfaces of the simulated controller: sockets, ptys, and the process around it."""
