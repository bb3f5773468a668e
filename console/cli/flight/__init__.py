"""Commands on flight recordings."""
