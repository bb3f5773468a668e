"""How a chuck bends, moves and holds a part: reaction forces, elastic ring, contact of the jaws, grip."""
