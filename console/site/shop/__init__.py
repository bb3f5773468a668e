"""The database of a shop: what is recorded at each lathe, sent to PostgreSQL, and read from there."""
