"""The numbers that the project holds still: what is run, what of it is a quantity, and how it is compared."""
