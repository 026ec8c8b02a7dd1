"""How many random Principled BSDFs look as in Cycles. Prints a line for each and a summary.

    BLENDER_USER_SCRIPTS=… RELIEF_BINARY=… blender -b --factory-startup --python tests/blender/measure_random_principled.py -- \\
        [FIRST] [LAST] | --find SEED… | --only SEED NAME…

Not a test; shader_test.py takes the first three. Seeds are FIRST … LAST, 0 … 63. --find renders a seed again with each of its
inputs left at its default, one after another: where the difference goes, that input has to do with it. --only renders a seed
with the named inputs alone.
"""

import collections
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import random_principled as principled  # noqa: E402


def _shown(inputs):
    def number(value):
        return value if isinstance(value, str) else f"{value:.3g}"

    def text(value):
        return "(" + ", ".join(number(v) for v in value[:3]) + ")" if isinstance(value, tuple) else number(value)

    return "; ".join(f"{name} {text(value)}" for name, value in inputs.items())


def _compare(label, inputs, samples=32):
    found, difference = principled.compare(inputs, samples)
    # Blender prints between the lines.
    print(f"\n@ {label}: {principled.describe(found, difference)}", flush=True)
    return principled.judgement(found)


given = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
if given[:1] == ["--find"]:
    for seed in map(int, given[1:]):
        inputs = principled.values(seed)
        _compare(f"seed {seed}, {_shown(inputs)}", inputs, 64)
        for name in inputs:
            _compare(f"  without {name}", {n: v for n, v in inputs.items() if n != name}, 64)
elif given[:1] == ["--only"]:
    inputs = principled.values(int(given[1]))
    inputs = {name: inputs[name] for name in given[2:]}
    _compare(_shown(inputs), inputs, 128)
else:
    first, last = (int(n) for n in (given + ["0", "63"][len(given) :])[:2])
    counts = collections.Counter()
    for seed in range(first, last + 1):
        inputs = principled.values(seed)
        counts[_compare(f"seed {seed}, {_shown(inputs)}", inputs)] += 1
    print("@", dict(counts), "of", sum(counts.values()))
sys.stdout.flush()
os._exit(0)
