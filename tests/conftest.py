"""What all tests share: tables are as wide everywhere, also where tests run without a terminal."""

import os

os.environ["COLUMNS"] = "120"
