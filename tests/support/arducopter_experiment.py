"""``deadtime fly`` with the firmware, in a network that `arducopter.alone` has made."""

import subprocess
import sys

from arducopter import firmware

if __name__ == "__main__":
    with firmware("udpclient:127.0.0.1:14550"):
        command = [sys.executable, "-m", "deadtime", "fly", "--link", "udp:127.0.0.1:14550"]
        sys.exit(subprocess.call([*command, *sys.argv[1:]]))
