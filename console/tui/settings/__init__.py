"""Settings of the screens: themes, glyphs, own keys, and how they are applied while the console runs."""
