"""The lobed error: predicted from cutting forces, fitted to traces, scaled to what was found."""
