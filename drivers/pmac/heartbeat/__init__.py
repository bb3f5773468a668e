"""The heartbeat: a watchdog timer that the host renews, and the controller's PLC that acts when it runs out."""
