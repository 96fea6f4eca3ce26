"""The version, and when this process imported the package first: `__init__` imports this module."""

import time

__version__ = "0.3.0"
FIRST_IMPORT = time.time()
"""Whatever this process has of the package was read from the disk later."""
