"""Bad inputs for whatever reads a file, a message or an array, and what an input that is taken must keep."""
