"""What the hand does in a case: a path that it follows, or an experiment in closed loop."""
