"""Keys of scene files: quantities with units, names of links, registered kinds."""
