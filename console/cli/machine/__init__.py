"""Commands that operate a machine or its controller, simulated or real."""
