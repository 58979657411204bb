"""A seeded grid of valid runs over all keys of scenes, each of which must succeed.

A case is drawn from a family; it runs for a few turns, and then there must be no exception, no
early end but a jam that a second route confirms, no number that is not finite, no penetration,
and no energy that does not add up.
"""
