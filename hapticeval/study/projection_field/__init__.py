"""Projection fields: where a projection sends the inside of a model, where it jumps, and how much it amplifies."""
