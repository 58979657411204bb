"""Gears: involute teeth, the forces of a pair, trains and the choice of teeth."""
