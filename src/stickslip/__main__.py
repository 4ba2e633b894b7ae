"""The command line, as ``stickslip`` and as ``python -m stickslip``."""

import sys


def main() -> int:
    """Run the command line; an interrupt while libraries load is no error."""
    try:
        from stickslip import cli
    except KeyboardInterrupt:
        sys.stderr.write("stickslip: interrupted as it started\n")
        return 130
    return cli.main()


if __name__ == "__main__":
    sys.exit(main())
