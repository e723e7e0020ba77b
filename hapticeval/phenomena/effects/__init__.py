"""Checks of how a renderer shows the effects that a scene calls for, whoever shows them."""
