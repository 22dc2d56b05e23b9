# SPDX-License-Identifier: GPL-3.0-or-later
import sys

from .addon import stopping


def main():
    """The program `qh-unwrap`.  It can be stopped before anything else is there, since loading NumPy takes a while."""
    with stopping.stoppable():
        try:
            with stopping.undisturbed():
                from . import cli
            return cli.main(sys.argv[1:])
        except stopping.Stopped as stop:
            print(f"qh-unwrap: error: {stop}", file=sys.stderr)
            return stop.exit_code


if __name__ == "__main__":
    sys.exit(main())
