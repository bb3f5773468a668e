"""What a cut relies on, proven on the card at hand: with the drives killed where that is enough, else in air."""
