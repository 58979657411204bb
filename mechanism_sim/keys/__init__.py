"""Keys of scene files: quantities with units, names of links, kinds that register."""
