"""Other ways to simulate the loose four-bar, one module each; their packages are optional."""
