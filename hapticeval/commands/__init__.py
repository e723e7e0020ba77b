"""The commands beside `run` and `report`, a module each: they study rather than judge."""
