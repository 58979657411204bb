"""Geneva wheels."""
