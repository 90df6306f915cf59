"""A day in orbit: what the link delivers, a contact in time, and a constellation."""
