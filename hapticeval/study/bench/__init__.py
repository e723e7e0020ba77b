"""What accuracy costs in time: every setting of every renderer, its error against a reference, and its time."""
