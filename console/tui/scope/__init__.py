"""The page Scope: set-up, readings and files of what is gathered."""
