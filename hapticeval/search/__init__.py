"""The search for the smallest path that breaks a renderer: draw, judge, shrink, keep, replay."""
