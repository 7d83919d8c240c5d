"""How good and how fast placements are, side by side with other ways to find them, measured in one run."""
