"""Revolute joints: a pin in a bushing, or a shaft in its bearings."""
