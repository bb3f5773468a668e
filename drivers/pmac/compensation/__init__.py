"""Compensation tables: corrections of one motor by the position of others, and the cams made of them."""
