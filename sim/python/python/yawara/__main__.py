"""The program ``yawara``, as ``python -m yawara`` too."""

import signal
import sys

from . import _yawara


def main() -> int:
    """Runs the program with the words of the command line; returns the status that it ends with."""
    # Ctrl-C ends the program, as it does where there is no Python around it.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _yawara.run_command(["yawara", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
