"""What the pages show: numbers, words and plots, computed without NiceGUI."""
