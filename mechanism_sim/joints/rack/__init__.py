"""A pin and a slotted rack."""
