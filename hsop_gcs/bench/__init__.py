"""What can be measured in one run: placements beside other ways to find them, and the link under a large fleet."""
