"""Laws of contact: what an impact does, and when a sequence of impacts has ended."""
