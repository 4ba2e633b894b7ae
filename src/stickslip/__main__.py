"""The command line, as ``stickslip`` and as ``python -m stickslip``."""

import os
import sys


def main() -> int:
    """Run the command line; an interrupt during imports is reported in one line."""
    # Matrices here are small: threads would mostly wait for each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        from stickslip import cli
    except KeyboardInterrupt:
        sys.stderr.write("stickslip: interrupted as it started\n")
        return 130
    return cli.main()


if __name__ == "__main__":
    sys.exit(main())
