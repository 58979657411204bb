"""A pin in a slot."""
