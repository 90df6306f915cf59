"""`python -m microrad` is the command `microrad`."""

from microrad.cli import main

if __name__ == "__main__":
    main()
