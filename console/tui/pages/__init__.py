"""Numbered pages, one module each, with their content as pure functions beside them."""
