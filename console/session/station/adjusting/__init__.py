"""Override and trim of a running cut, on the operator's commands."""
