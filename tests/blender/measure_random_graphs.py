"""How many random graphs give the numbers that Cycles gives. Prints a line for each and a summary.

    BLENDER_USER_SCRIPTS=… RELIEF_BINARY=… blender -b --factory-startup --python tests/blender/measure_random_graphs.py -- \\
        [FIRST] [LAST] | --find SEED…

Not a test; random_graph_test.py takes the first of these. Seeds are FIRST … LAST, 1 … 200. --find shows for each node of a
graph how many of its values differ, and marks those that do not have it from their inputs.
"""

import collections
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import bpy  # noqa: E402
import random_graph_test as test  # noqa: E402
import random_graphs  # noqa: E402
import scenes  # noqa: E402


def _sources(output, made):
    """Numbers of the outputs that a node reads, past clamps and reroutes."""
    found, waiting = set(), [output.node]
    while waiting:
        node = waiting.pop()
        for socket in node.inputs:
            if not socket.is_linked:
                continue
            source = socket.links[0].from_socket
            if source in made:
                found.add(made.index(source))
            else:
                waiting.append(source.node)
    return found


def _find(seed):
    scenes.new_scene()
    tree = bpy.data.materials.new("described")
    tree.use_nodes = True
    tree = tree.node_tree
    xyz, w = tree.nodes.new("ShaderNodeCombineXYZ"), tree.nodes.new("ShaderNodeValue")
    xyz.name, w.name = "xyz", "w"
    _, made = random_graphs.grow(seed, tree, xyz.outputs[0], w.outputs[0])
    # Comparing makes new scenes, in which these nodes are not.
    texts = [random_graphs.describe(output) for output in made]
    sources = [_sources(output, made) for output in made]
    results = test.compare_trees({number: random_graphs.builder(seed, number) for number in range(len(texts))})
    for number, text in enumerate(texts):
        result = results[number]
        inherited = max((results[source].off for source in sources[number]), default=0.0)
        mark = ">>" if result.off > 0.002 and result.off > 4 * inherited else "  "
        print(f"{mark} {result.off:8.3%} median {result.median:.1g} spread {result.spread:.2g}: {text}")


given = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
if given[:1] == ["--find"]:
    for number in given[1:]:
        print("seed", number)
        _find(int(number))
    sys.stdout.flush()
    os._exit(0)
first, last = (int(n) for n in (given + ["1", "200"][len(given) :])[:2])
results = {}
for start in range(first, last + 1, test.GRAPHS_A_SHEET):
    results.update(test.compare(range(start, min(start + test.GRAPHS_A_SHEET, last + 1))))
for seed, result in results.items():
    print(f"seed {seed}: {result}", flush=True)
counts = collections.Counter(result.judgement for result in results.values())
print(dict(counts), "of", len(results))
sys.stdout.flush()
os._exit(0)
