"""The mission being edited: its text with its comments, and what is changed in it."""
