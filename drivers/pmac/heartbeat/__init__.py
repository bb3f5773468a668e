"""The heartbeat: a lease that the host renews, and the PLC on the card that ends things when it runs out."""
