"""Devices that a renderer drives in closed loop."""
