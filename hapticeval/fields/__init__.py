"""Projection fields: where a projection sends the inside of a model, where it jumps, and how much it amplifies.

Everything here is geometry of a function from HIPs to IHIPs; `hapticeval.projecting` makes one of a renderer.
"""
