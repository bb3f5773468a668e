"""What the page Preview explains on demand: the band, the highest safe speed, the inverted response."""
