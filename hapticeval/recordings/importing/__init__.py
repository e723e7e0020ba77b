"""Foreign files as recordings: mappings, units, conversion and proposals."""
