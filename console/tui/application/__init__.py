"""The application below its pages: terminal and keys, scanned codes, appearance, bell, link; leaving."""
