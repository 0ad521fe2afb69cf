"""What a server and a worker say to each other: one JSON object a line, commands to its stdin, messages from its stdout.

The first command says what to do; a worker does one thing and ends, unless it is told to stay: then it says `ready` after
`done`, and more work of the same job may come. Paths are relative: those of commands to the job folder (read-only), those of
messages to the output folder. The server believes nothing of a message before it has checked it.

Commands
    {"do": "check", "file": "shot.usdz" | "package", "kind": "usda|usdc|usdz|zip", "entry": "shot.usda" | null, "limits": {..}}
    {"do": "render", "file": "package/shot.usda", "settings": {RenderSettings as JSON}, "checkpoint": "checkpoint.prc" | null,
     "number": 3, "checkpoint_every_s": 10, "picture_only": false, "preview": true, "limits": {..}, "traceparent": "..",
     "outputs": ["beauty.exr", "beauty.png", "report.json"], "spent_s": 3.5, "fraction": 0.4,
     "part": false, "stay": true, "files": {"exposure": 1.5, ..},
     "products": {"named": ["/Render/beauty", ..] | null, "name_end": ".0012"}}
        goes on from `checkpoint` (whose number is `number`), or begins; `picture_only`: take no more samples, write the
        outputs; `preview`: as the command of that name, from the start; `outputs`: what files are to be called, by whose
        endings the worker knows what they are; `spent_s`: seconds of sampling before this run that the settings' time limit
        counts; `fraction`: of progress that was told before; `stay`: after `done`, for more work;
        `files`: members of FileSettings; `products`: all or those named, in files of their own names, which `name_end` ends;
        `part`: the settings name a range of samples; take them and leave a checkpoint, without previews and without a picture
        (then: checkpoint, done with no outputs and a report {"stop", "samples", "rays"})
    {"do": "merge", "parts": ["checkpoint.prc", "part-8.prc"], "number": 3, "metric": "relmse", "target": 0.01 | null,
     "limits": {..}}
        put disjoint parts together (then: checkpoint, preview, row, done with no outputs and a report {"samples", "parts":
        {"ranges": [[0, 64]], "rays", "error", "target_met"}})
    {"do": "stop"}     end soon with a checkpoint and the picture so far           (then: checkpoint, done; done with no outputs
                       and a report {"interrupted": true, "samples": 0} where there is no picture yet)
    {"do": "yield"}    end soon with a checkpoint                                  (then: checkpoint, yielded)
    {"do": "preview"}  write a preview soon, and for the next ten seconds after each pass

Messages, by "at"
    ready      it has imported what takes long, and waits for its first command
    phase      {"phase": "opening|translating|building|sampling|writing"}
    effective  {"settings": {..}, "features": [..], "scene": {counts}, "resolution": [w, h]}: what scene and request resolved to
    warning    {"code", "prim", "detail", "severity", "kind", "attribute"}
    progress   {"fraction", "samples_done" (mean a pixel), "samples_min", "samples_max", "rays", "rays_per_s", "elapsed_s"
    (sampling),
                "error": {"metric", "estimate", "ci95", "target", "kind": "estimated"} | null, "eta_s" | null, "eta_ci95" |
                null, "pass"}
    row        a row of the convergence curve: {"t_s", "samples", "relmse", "ci95", "rmse"}
    preview    {"pass", "file", "bytes", "samples"}: worker/preview.py says what is in the file; each has a larger pass than the
               one before
    checkpoint {"number": 4, "file", "bytes", "samples", "seconds"}: takes the place of number 3
    facts      {..}: what a check found
    done       {"outputs": [{"name", "file", "bytes", "sha256", "media_type"}], "report": {..}}
               (the report without its diagnostics, which were warnings: the file has them)
    yielded    {"number": 4}
    failed     {"problem": {"type": "/problems/..", "title", "status", "detail", ...}}
After done (where it is not to stay), yielded, facts or failed a worker exits with 0; any other end is a crash. What it is told
between `done` and more work, it does not heed.
"""

from __future__ import annotations

MAX_LINE_BYTES = 4 * 2**20

PHASES = ("opening", "translating", "building", "sampling", "writing")
WORK = ("check", "render", "merge")
LAST = ("facts", "done", "yielded", "failed")
