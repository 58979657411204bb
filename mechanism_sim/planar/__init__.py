"""Planar rigid bodies: the tree of links, its equations of motion, and two protocols."""
