"""A pin in a slot along an arc."""
