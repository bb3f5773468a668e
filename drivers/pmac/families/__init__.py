"""The tables of each family of controllers."""
