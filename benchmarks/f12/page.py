"""The results of run.py as a table and as a page with the pictures."""

import html
import math

_HEAD = (
    "scene", "until", "engine", "processor s", "wall s", "MiB", "relMSE", "time, ratio", "at equal noise", "mean, ratio",
    "blocks differ (by noise)",
)
_STYLE = """body { font: 14px sans-serif; margin: 2em; background: #222; color: #ddd }
table { border-collapse: collapse } td, th { padding: .2em .6em; text-align: right; border-bottom: 1px solid #444 }
figure { display: inline-block; margin: .3em } figcaption { font-size: 12px } img { display: block }"""


def _cells(name, row):
    return (
        name,
        row["setting"],
        row["label"],
        f"{row['processor_seconds']:.1f}",
        f"{row['wall_seconds']:.1f}",
        f"{row['peak_memory_bytes'] / 2**20:.0f}",
        f"{row['relmse']:.3g}",
        f"{row['time']:.2f}",
        f"{row['equal_noise']:.2f}",
        f"{row['mean']:.4f}",
        f"{100 * row['blocks']:.1f} % ({100 * row['blocks_noise']:.1f} %)",
    )


def _geometric_mean(values):
    return math.exp(sum(map(math.log, values)) / len(values)) if values and min(values) > 0 else math.nan


def _means(scenes):
    """Rows of geometric means over the scenes, one for each setting and each contender but the first."""
    groups = {}
    for scene in scenes:
        for row in scene["rows"]:
            groups.setdefault((row["setting"], row["label"]), []).append(row)
    first = scenes[0]["rows"][0]["label"] if scenes else None
    for (setting, label), rows in groups.items():
        if label != first:
            ratios = [f"{_geometric_mean([row[key] for row in rows]):.2f}" for key in ("time", "equal_noise")]
            yield (f"all {len(rows)}", setting, label, "", "", "", "", *ratios, "", "")


def _rows(scenes, is_last=True):
    rows = [_cells(scene["name"], row) for scene in scenes for row in scene["rows"]]
    return rows + list(_means(scenes)) if is_last else rows


def table(scenes, is_last=True):
    """Markdown.

    @param  scenes   results of Bench.measure
    @param  is_last  with head and means; otherwise rows alone
    """
    lines = ["| " + " | ".join(row) + " |" for row in _rows(scenes, is_last)]
    head = [f"| {' | '.join(_HEAD)} |", f"| --- | --- | --- |{' ---: |' * (len(_HEAD) - 3)}"] if is_last else []
    return "\n".join(head + lines)


def page(scenes, version):
    """HTML with all pictures, which lie beside it."""
    parts = [f"<!DOCTYPE html><meta charset='utf-8'><title>F12</title><style>{_STYLE}</style>"]
    parts.append(f"<h1>F12: relief beside Cycles {html.escape(version)}</h1><table>")
    parts += [f"<tr>{''.join(f'<th>{html.escape(cell)}</th>' for cell in _HEAD)}</tr>"]
    parts += [f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in row)}</tr>" for row in _rows(scenes)]
    parts.append("</table>")
    for scene in scenes:
        parts.append(f"<h2>{html.escape(scene['name'])}</h2>")
        for row in scene["rows"]:
            caption = f"{row['label']}, {row['setting']}: {row['processor_seconds']:.1f} s, relMSE {row['relmse']:.3g}"
            source = html.escape(row["files"][0], quote=True)
            parts.append(f"<figure><img src='{source}.png'><figcaption>{html.escape(caption)}</figcaption></figure>")
    return "\n".join(parts)
