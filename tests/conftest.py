"""What all tests share: tables are as wide everywhere, also where tests run without a terminal; Ctrl-C interrupts."""

import os
import signal

os.environ["COLUMNS"] = "120"
# a shell that starts this in the background has it ignore Ctrl-C, and so would the processes that tests start
signal.signal(signal.SIGINT, signal.default_int_handler)
