"""The simulated hardware: axes, workpiece and gauge."""
