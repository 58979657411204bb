"""Linkages of revolute joints: loop closure, and the bearing as relation or gap."""
