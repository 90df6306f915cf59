"""Recordings, the virtual bench, and a mirror model out of them."""
