"""What the terminal can do beyond keys: report their release, and ring."""
