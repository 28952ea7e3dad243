"""The command line."""

import signal
import sys

from athermal import _athermal


def main() -> int:
    # A command ends as the program does, and not as Python would.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _athermal.main(["athermal", *sys.argv[1:]], [sys.executable, "-m", "athermal"])


if __name__ == "__main__":
    sys.exit(main())
