"""Commands that work a machine or its controller, simulated or real."""
