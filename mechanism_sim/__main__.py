"""``python -m mechanism_sim``."""

from mechanism_sim.cli import main

if __name__ == '__main__':
    main()
