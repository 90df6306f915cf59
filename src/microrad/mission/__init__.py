"""A text file into checked SI records that know where each value comes from."""
