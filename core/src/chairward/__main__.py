"""`python -m chairward`: the same as the `chairward` command."""

from chairward.cli import main

if __name__ == "__main__":
    main()
