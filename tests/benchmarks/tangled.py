# SPDX-License-Identifier: GPL-3.0-or-later
"""How many tangled maps come out without flips within borders that are held: `python -m tests.benchmarks.tangled`."""

from time import process_time

import numpy as np

from qh_unwrap.core import Settings, unwrap
from qh_unwrap.core.certificate import is_injective

from ..core.borders import KINDS, tangled

_EACH = 100


def main():
    print(f"{'border':<10}{'untangled':>10}{'said valid and is not':>24}{'seconds, median':>17}{'most':>8}")
    for kind in KINDS:
        good, wrong, seconds = 0, 0, []
        for seed in range(_EACH):
            vertices, triangles, uv, count = tangled(kind, seed)
            start = process_time()
            result = unwrap(vertices, triangles, Settings(boundary="KEEP"), uv=uv)
            seconds.append(process_time() - start)
            held = np.array_equal(result.uv[:count], uv[:count])
            valid = held and is_injective(result.uv, triangles, [np.arange(count)])
            good += valid
            wrong += result.report.injective and not valid
        most = max(seconds)
        print(f"{kind:<10}{good:>6} of {_EACH}{wrong:>21}{np.median(seconds):>17.2f}{most:>8.2f}", flush=True)


if __name__ == "__main__":
    main()
