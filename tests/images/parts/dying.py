"""As primray.distributed.local_processes, but the first process is killed: python -m tests.images.parts.dying"""

from __future__ import annotations

import os
import signal
from pathlib import Path

from primray.distributed.local_processes import main

if __name__ == "__main__":
    try:
        Path(os.environ["PRIMRAY_TEST_DIED"]).touch(exist_ok=False)
    except FileExistsError:
        main()
    else:
        os.kill(os.getpid(), signal.SIGKILL)
