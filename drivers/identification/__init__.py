"""Identification: a small sine through the controller, the tool's answer gathered, gain and phase of each path."""
