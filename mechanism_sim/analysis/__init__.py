"""From bags to numbers: what a recorded run did, and whether all of it was recorded."""
