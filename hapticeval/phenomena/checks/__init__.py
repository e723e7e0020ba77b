"""The checks: one in a module of its name, or a family in one: that of an effect, or of relations between runs."""
