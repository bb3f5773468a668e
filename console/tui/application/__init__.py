"""The application from below: what it wears, how it is left, what it hears from the terminal."""
