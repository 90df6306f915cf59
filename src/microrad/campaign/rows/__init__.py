"""What a row is: its drawn numbers, its mission, its fine-pointing loop with its runs, and its outputs."""
