"""When two terminals see each other, what limits them, and how the line of sight between them moves."""
