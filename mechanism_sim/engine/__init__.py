"""Motion between and through events: modes of contact, one event loop, solutions."""
