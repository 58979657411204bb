"""Links that touch: disc against disc, disc against bar."""
