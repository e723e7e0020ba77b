"""Renderers that are not Python: libraries with the C ABI of `hapticeval.h`, and processes that speak JSON lines."""
