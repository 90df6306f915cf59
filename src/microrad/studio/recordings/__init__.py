"""Recordings from outside: stored under limits, and read by a process of their own."""
