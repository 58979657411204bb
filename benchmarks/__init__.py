"""Measurements that anyone can repeat: what is hard, what it costs, how exact it is."""
