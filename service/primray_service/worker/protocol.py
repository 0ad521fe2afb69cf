"""Protocol between a server and a worker: one JSON object a line, commands to its stdin, messages from its stdout.

The first command names the chunk; a worker runs one chunk and ends, unless the command asks it to stay: then it sends `ready`
after `done`, and another chunk of the same job may come. Paths are relative: those of commands to the job folder, which is
read-only, those of messages to the output folder. The server validates every message before it uses it.

Commands
    {"do": "check", "file": "shot.usdz" | "package", "kind": "usda|usdc|usdz|zip", "entry": "shot.usda" | null, "limits": {..}}
    {"do": "render", "file": "package/shot.usda", "settings": {RenderSettings as JSON}, "checkpoint": "checkpoint.prc" | null,
     "number": 3, "checkpoint_every_s": 10, "picture_only": false, "preview": true, "limits": {..}, "traceparent": "..",
     "outputs": ["beauty.exr", "beauty.png", "report.json"], "spent_s": 3.5, "fraction": 0.4,
     "part": false, "stay": true, "files": {"exposure": 1.5, ..},
     "products": {"named": ["/Render/beauty", ..] | null, "name_end": ".0012"}}
        resumes from `checkpoint` (whose number is `number`), or begins; `picture_only`: take no more samples, write the
        outputs; `preview`: like the command of that name, from the start; `outputs`: names of files, whose extensions
        determine their formats; `spent_s`: earlier seconds of sampling that count towards the settings' time limit;
        `fraction`: progress reported before; `stay`: after `done`, for another chunk;
        `files`: members of FileSettings; `products`: all or those named, in files of their own names with suffix `name_end`;
        `part`: the settings name a range of samples; take them and leave a checkpoint, without previews and without a picture
        (then: checkpoint, done with no outputs and a report {"stop", "samples", "rays"})
    {"do": "merge", "parts": ["checkpoint.prc", "part-8.prc"], "number": 3, "metric": "relmse", "target": 0.01 | null,
     "limits": {..}}
        merges disjoint parts (then: checkpoint, preview, row, done with no outputs and a report {"samples", "parts":
        {"ranges": [[0, 64]], "rays", "error", "target_met"}})
    {"do": "stop"}     end soon with a checkpoint and the picture so far           (then: checkpoint, done; done with no outputs
                       and a report {"interrupted": true, "samples": 0} if there is no picture yet)
    {"do": "yield"}    end soon with a checkpoint                                  (then: checkpoint, yielded)
    {"do": "preview"}  write a preview soon, and for the next ten seconds after each pass

Messages, by "at"
    ready      slow imports are done; it waits for a command
    phase      {"phase": "opening|translating|building|sampling|writing"}
    effective  {"settings": {..}, "features": [..], "scene": {counts}, "resolution": [w, h]}: after resolving scene and request
    warning    {"code", "prim", "detail", "severity", "kind", "attribute"}
    progress   {"fraction", "samples_done" (mean a pixel), "samples_min", "samples_max", "rays", "rays_per_s", "elapsed_s"
    (sampling),
                "error": {"metric", "estimate", "ci95", "target", "kind": "estimated"} | null, "eta_s" | null, "eta_ci95" |
                null, "pass"}
    row        a row of the convergence curve: {"t_s", "samples", "relmse", "ci95", "rmse"}
    preview    {"pass", "file", "bytes", "samples"}: worker/preview.py describes the file; passes increase
    checkpoint {"number": 4, "file", "bytes", "samples", "seconds"}: replaces number 3
    facts      {..}: results of a check
    done       {"outputs": [{"name", "file", "bytes", "sha256", "media_type"}], "report": {..}}
               (the report without its diagnostics, which were warnings: the file has them)
    yielded    {"number": 4}
    failed     {"problem": {"type": "/problems/..", "title", "status", "detail", ...}}
After done (unless it stays), yielded, facts or failed a worker exits with 0; any other end is a crash. Between `done` and
the next chunk it ignores commands.
"""

from __future__ import annotations

MAX_LINE_BYTES = 4 * 2**20

PHASES = ("opening", "translating", "building", "sampling", "writing")
WORK = ("check", "render", "merge")
LAST = ("facts", "done", "yielded", "failed")
