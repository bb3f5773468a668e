"""The iron: axes, workpiece and gauge."""
