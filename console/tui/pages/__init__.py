"""The numbered pages, one module each, with what they show as pure functions beside them."""
