"""Robots behind a small protocol: a data acquisition driver, the simulated twin, and the loop that runs them."""
