"""Recordings and their file format."""
