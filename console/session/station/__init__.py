"""The session engine: it owns the machine on a thread of its own, obeys commands and publishes the state."""
