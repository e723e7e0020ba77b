"""Robots behind a small protocol: a data acquisition driver, the simulated twin, and the loop that runs them.

Rows of the loop go through `recordings.recorder` to a process that writes a journal, of which a recording is made.
"""
