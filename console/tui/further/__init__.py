"""The pages without a digit, and what they show."""
