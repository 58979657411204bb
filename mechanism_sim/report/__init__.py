"""Reports of a run for people: summaries, tables, progress."""
