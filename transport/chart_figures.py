"""Draws the figures of `afterglow chart` from runs.json, which lies beside this file: SVG and PNG."""
import json
import pathlib

import matplotlib
import numpy as np
matplotlib.use("Agg")
import matplotlib.colors
import matplotlib.pyplot as plt
from matplotlib.ticker import FuncFormatter

folder = pathlib.Path(__file__).resolve().parent
chart = json.loads((folder / "runs.json").read_text())
scenes = list(dict.fromkeys(run["scene"] for run in chart["runs"]))

# Colours that are told apart without red and green (Okabe and Ito), and a shape for each besides.
LOOKS = {
    "target": ("#0072B2", "o", "target error"),
    "spacing": ("#56B4E9", "s", "spacing by hand"),
    "dense": ("#009E73", "^", "every link kept"),
    "flat": ("#E69F00", "v", "one level of functions"),
    "paper": ("#D55E00", "D", "as printed (2008)"),
    "path": ("#000000", "x", "path tracer, one picture"),
}
PARAMETERS = {
    "rays": "gather rays of a receiver",
    "receiver_levels": "levels of receivers",
    "sender_levels": "levels of senders",
    "threshold": "threshold of links / the usual",
    "bounces": "bounces",
}
STAGES = ["points", "push", "pull", "gather", "rows", "links", "series"]
STAGE_COLOURS = ["#0072B2", "#56B4E9", "#009E73", "#E69F00", "#D55E00", "#CC79A7", "#999999"]

plt.rcParams.update({"font.size": 9, "axes.grid": True, "grid.alpha": 0.3, "axes.spines.top": False,
                     "axes.spines.right": False, "legend.frameon": False, "svg.hashsalt": "afterglow"})
plain = FuncFormatter(lambda value, _: f"{value:g}")


def runs(scene, sweep):
    return [run for run in chart["runs"] if run["scene"] == scene and run["sweep"] == sweep]


def errors(points):
    return [100 * p["rel_rmse"] for p in points], [100 * p["standard_error"] for p in points]


def percent_axis(axes):
    axes.set_yscale("log")
    axes.set_ylabel("relRMSE of indirect irradiance [%]")
    axes.yaxis.set_major_formatter(plain)
    axes.yaxis.set_minor_formatter(FuncFormatter(
        lambda value, _: f"{value:g}" if f"{value:e}"[0] in "235" else ""))


def finish(figure, name, about):
    figure.text(0.01, 0.005, f"{about}. {chart['places']} points, {chart['lights']} random spotlights, "
                f"seed {chart['seed']}; {chart['machine'].strip()}, {chart['threads']} threads; "
                f"Afterglow {chart['version']}", fontsize=6, color="#555555")
    figure.tight_layout(rect=(0, 0.03, 1, 1))
    for ending in ("svg", "png"):
        unfinished = folder / f"{name}.part.{ending}"
        figure.savefig(unfinished, dpi=150, metadata={"Date": None} if ending == "svg" else None)
        unfinished.replace(folder / f"{name}.{ending}")
    plt.close(figure)


def floors(scene):
    """What the error of the spacing by hand is made of, against time."""
    points = sorted(runs(scene, "spacing"), key=lambda p: p["seconds"])
    return [([(p["seconds"], p[f"{part}_error"]) for p in points if p[f"{part}_error"] > 0], style, text)
            for part, style, text in (("senders", "-", "floor: senders"), ("links", "--", "floor: rays and dropped links"),
                                      ("receivers", ":", "floor: between receivers"))]


def other_links(scene):
    """The spacing by hand, had links been stored in other ways: the same error, other bytes."""
    points = sorted(runs(scene, "spacing"), key=lambda p: p["bytes"])
    stored = 3  # bytes of a packed link
    return [([(p["bytes"] + (size - stored) * p["links"], p["rel_rmse"]) for p in points], style, text)
            for size, style, text in ((16, "-", "computed: floats and an index"), (10, "--", "computed: half floats and an index"),
                                      (2, ":", "computed: scalar, packed"))]


def error_against(scene, key, label, factor, sweeps, name, extra=()):
    if not any(runs(scene, sweep) for sweep in sweeps):
        return
    figure, axes = plt.subplots(figsize=(8.2, 4.4))
    for sweep in sweeps:
        points = sorted(runs(scene, sweep), key=lambda p: p[key])
        if not points:
            continue
        colour, marker, text = LOOKS[sweep]
        error, bar = errors(points)
        axes.errorbar([factor * p[key] for p in points], error, yerr=bar, color=colour, marker=marker,
                      markersize=5, linewidth=1.2, capsize=2, label=text,
                      linestyle="--" if sweep == "path" else "-")
    for points, style, text in extra:
        axes.plot([factor * x for x, _ in points], [100 * y for _, y in points], style, color="#888888",
                  linewidth=1.0, label=text)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(plain)
    axes.set_xlabel(label)
    percent_axis(axes)
    reference = [p["reference_error"] for p in runs(scene, "spacing") if p["reference_error"] > 0]
    if reference:
        axes.axhline(100 * max(reference), color="#999999", linewidth=0.8, linestyle=":")
        axes.text(axes.get_xlim()[0], 100 * max(reference), " the reference's own noise (taken out)",
                  fontsize=6, color="#777777", va="bottom")
    axes.set_title(scene)
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    finish(figure, f"{name}_{file_name(scene)}", scene)


def file_name(scene):
    return scene.replace(":", "_").replace("/", "_")


def parameters(scene):
    present = [p for p in PARAMETERS if runs(scene, p)]
    if not present:
        return
    figure, grid = plt.subplots(2, 3, figsize=(9.6, 5.6), sharey=True)
    for axes, sweep in zip(grid.flat, present):
        points = sorted(runs(scene, sweep), key=lambda p: p["value"] if p["value"] or sweep != "bounces" else 1e9)
        error, bar = errors(points)
        at = range(len(points))
        axes.errorbar(at, error, yerr=bar, color="#0072B2", marker="o", markersize=4, capsize=2)
        axes.set_xticks(list(at), ["all" if sweep == "bounces" and p["value"] == 0 else f"{p['value']:g}"
                                   for p in points])
        axes.set_xlabel(PARAMETERS[sweep])
        percent_axis(axes)
        axes.set_ylabel("")
        seconds = axes.twinx()
        seconds.plot(at, [p["seconds"] for p in points], color="#E69F00", marker=".", linewidth=0.8)
        seconds.set_ylabel("precomputation [s]", color="#B97F00", fontsize=7)
        seconds.set_ylim(bottom=0)
        seconds.grid(False)
    for axes in list(grid.flat)[len(present):]:
        axes.axis("off")
    for row in grid:
        row[0].set_ylabel("relRMSE [%]")
    figure.suptitle(f"{scene}: one parameter alone, at twice the usual spacing (blue error, orange time)")
    finish(figure, f"parameters_{file_name(scene)}", scene)


def stages(scene):
    points = sorted(runs(scene, "spacing"), key=lambda p: -p["value"])
    figure, axes = plt.subplots(figsize=(6.4, 3.6))
    bottom = [0.0] * len(points)
    for stage, colour in zip(STAGES, STAGE_COLOURS):
        share = [100 * p[f"{stage}_seconds"] / p["seconds"] for p in points]
        if max(share) < 0.05:
            continue
        axes.bar(range(len(points)), share, bottom=bottom, color=colour, label=stage, width=0.7)
        bottom = [a + b for a, b in zip(bottom, share)]
    axes.set_xticks(range(len(points)), [f"{p['value']:g}\n{p['seconds']:.1f} s" for p in points])
    axes.set_xlabel("spacing / the usual, and time of all")
    axes.set_ylabel("share of the precomputation [%]")
    axes.legend(ncols=1, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    axes.set_title(scene)
    finish(figure, f"stages_{file_name(scene)}", scene)


def picture(scene):
    """Where the error of default settings lies, under the hardest light."""
    file = folder / f"map_{file_name(scene)}.json"
    if not file.exists():
        return
    data = json.loads(file.read_text())
    shape = (data["height"], data["width"])
    reference = np.array(data["reference"]).reshape(shape)
    difference = np.ma.masked_where(reference < 0, np.array(data["difference"]).reshape(shape))
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.2))
    shown = left.imshow(np.ma.masked_where(reference < 0, reference), cmap="viridis",
                        norm=matplotlib.colors.LogNorm(0.01, max(1.0, reference.max())))
    figure.colorbar(shown, ax=left, label="irradiance / mean", shrink=0.85)
    left.set_title("path tracer", fontsize=9)
    shown = right.imshow(difference, cmap="PuOr",
                         norm=matplotlib.colors.SymLogNorm(linthresh=0.02, vmin=-1.0, vmax=1.0))
    figure.colorbar(shown, ax=right, label="(ours - path tracer) / mean", shrink=0.85,
                    ticks=[-1, -0.1, 0, 0.1, 1], format=plain)
    right.set_title(f"error: relRMSE {100 * data['rel_rmse']:.1f} %, the path tracer's noise "
                    f"{100 * data['reference_error']:.1f} %", fontsize=9)
    for axes in (left, right):
        axes.set_xticks([])
        axes.set_yticks([])
        axes.grid(False)
    finish(figure, f"error_map_{file_name(scene)}", f"{scene}, the hardest of its lights, default settings")


def break_even():
    """Precomputation over a path traced picture of equal error: its error goes like time to the -1/2."""
    figure, axes = plt.subplots(figsize=(8.2, 4.4))
    colours = [look[0] for look in LOOKS.values()] + ["#CC79A7", "#F0E442"]
    found = False
    for k, scene in enumerate(scenes):
        traced = runs(scene, "path")
        points = sorted(runs(scene, "target"), key=lambda p: p["rel_rmse"])
        if not traced or not points:
            continue
        best = max(traced, key=lambda p: p["value"])
        ratio = [p["seconds"] / (best["seconds"] * (best["rel_rmse"] / p["rel_rmse"]) ** 2) for p in points]
        axes.plot([100 * p["rel_rmse"] for p in points], ratio, marker="osD^vP*Xh"[k % 9], markersize=5,
                  color=colours[k % len(colours)], linewidth=1, label=scene)
        found = True
    if not found:
        plt.close(figure)
        return
    axes.axhline(0.3, color="#555555", linewidth=0.8, linestyle=":")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.xaxis.set_major_formatter(plain)
    axes.xaxis.set_minor_formatter(FuncFormatter(
        lambda value, _: f"{value:g}" if f"{value:e}"[0] in "235" else ""))
    axes.yaxis.set_major_formatter(plain)
    axes.set_xlabel("relRMSE of indirect irradiance [%]")
    axes.set_ylabel("precomputation / path traced picture")
    axes.set_title("Break-even with one picture of 1280 x 720 pixels and equal error")
    axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    finish(figure, "break_even", f"{len(scenes)} scene{'s' if len(scenes) > 1 else ''}")


for scene in scenes:
    error_against(scene, "seconds", "time [s]", 1.0, LOOKS, "error_time", floors(scene))
    operators = [sweep for sweep in LOOKS if sweep != "path"]
    error_against(scene, "bytes", "transfer file [MB]", 1e-6, operators, "error_bytes", other_links(scene))
    error_against(scene, "update_seconds", "one update of light [ms]", 1e3, operators, "error_update")
    parameters(scene)
    if runs(scene, "spacing"):
        stages(scene)
    picture(scene)
break_even()
