"""Bags: MCAP files of ROS 2 messages, written so that a kill cannot spoil them, read anyhow."""
