"""Cams: laws of motion of a follower, and the shape of the cam that gives it ([V] chapter 4)."""
