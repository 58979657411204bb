"""Analysis of recorded runs, and checks whether they were recorded completely."""
