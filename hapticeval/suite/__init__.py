"""Suites: files of cases, each a scene, a stimulus and the checks that judge it."""

DEFAULT_SUITE = "thesis"
"""What is judged if no suite is named."""
