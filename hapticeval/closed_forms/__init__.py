"""Closed forms of the closed loop: its equations of motion in continuous time, and the motions that follow."""
