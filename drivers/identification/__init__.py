"""Identification: command a small sine, gather the tool's answer, return gain and phase of each path."""
