"""``python -m ctrl_df``: the same as the command ``ctrl-df``."""

import sys

from .cli import main

if __name__ == "__main__":
    sys.exit(main())
