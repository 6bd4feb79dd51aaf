"""`python -m regbench` is the command line."""

import sys

from regbench.cli.main import main

sys.exit(main())
