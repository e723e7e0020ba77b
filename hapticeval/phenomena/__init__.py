"""The phenomena of thesis section 3.2 as checks, a module each, and what a verdict is."""
