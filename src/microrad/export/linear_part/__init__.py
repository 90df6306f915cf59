"""A controller's linear part in small blocks of states: which modes it has, and it without superfluous ones."""
