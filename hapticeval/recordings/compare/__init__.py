"""Runs held against each other: aligned by place, tested, and sample by sample."""
