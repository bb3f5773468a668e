"""Requests beside the polls: typed queries, watched values, readings of the configuration, data gathering."""
