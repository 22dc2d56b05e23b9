# SPDX-License-Identifier: GPL-3.0-or-later
"""The default unwrap of one mesh in a process of its own, so that the peak of the memory is the unwrap's.

    python -m tests.benchmarks.one_unwrap mesh.npz [times]

The last line of its output is JSON: seconds of each call, and the peak resident memory in bytes.
"""

import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np


def alone(mesh, times):
    """What such a process says of the mesh unwrapped so many times."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "mesh.npz")
        np.savez(path, vertices=mesh[0], triangles=mesh[1])
        command = [sys.executable, "-m", "tests.benchmarks.one_unwrap", str(path), str(times)]
        output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return json.loads(output.splitlines()[-1])


def main():
    from .generated import hills
    from .in_blender import extension, unwrapped
    from .measuring import measures

    path, times = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 1
    with np.load(path) as arrays:
        mesh = arrays["vertices"], arrays["triangles"]
    with extension():
        unwrapped(hills(500))  # what happens only once does not count
        runs = [unwrapped(mesh) for _ in range(times)]
    peak = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    after = measures(*mesh, runs[-1][1])
    found = {"seconds": [seconds for seconds, _ in runs], "peak": peak}
    print(json.dumps(found | {name: after[name] for name in ("energy", "flips")}), flush=True)


if __name__ == "__main__":
    main()
