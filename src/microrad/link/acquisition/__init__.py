"""Acquisition of the laser link: scans, the sequence of beacon, answer and lock, and their trade."""
