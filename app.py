"""Starts the web app; nothing else. A demo host sets GRADIO_SERVER_NAME and GRADIO_SERVER_PORT."""

import os
import sys

from playground.cli import main

if __name__ == "__main__":
    host = os.environ.get("GRADIO_SERVER_NAME", "127.0.0.1")
    port = os.environ.get("GRADIO_SERVER_PORT", "7860")
    sys.exit(main(["app", "--host", host, "--port", port]))
