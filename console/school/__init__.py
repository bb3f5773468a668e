"""What a trainee and an instructor use: lessons, tries, practice from a recording, the instructor's line."""
