"""Examples; those in folders are what `hapticeval new` writes."""
