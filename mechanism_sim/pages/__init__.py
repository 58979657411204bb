"""What a browser shows of a machine: pages of runs that are over, and of runs under way."""
