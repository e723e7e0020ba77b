"""A suite of three short slides along a plane, for the tests of the commands and of the API."""

HEAD = 'title = "Slides"\n'
CASE = """
[[case]]
name = "{name}"
title = "Along a plane"
model = {{ kind = "line" }}
checks = {checks}
trajectory = {{ kind = "points", points = {points}, duration = 0.2 }}
"""
SLIDES = {
    "flat": (["continuous-contact", "memoryless"], [[0.0, -0.001], [0.019, -0.001]]),
    "flat-back": (["continuous-contact"], [[0.02, -0.001], [0.0, -0.001]]),
    "flat-again": (["continuous-contact"], [[0.0, -0.001], [0.019, -0.001]]),
}
CASES = {name: CASE.format(name=name, checks=checks, points=points) for name, (checks, points) in SLIDES.items()}
