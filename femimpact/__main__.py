"""`python -m femimpact`."""

from femimpact.cli import main

if __name__ == "__main__":
    main()
