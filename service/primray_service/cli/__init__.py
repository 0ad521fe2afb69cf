"""The service's commands of `primray`; renderer/primray/cli/app.py finds them through COMMANDS.

    serve.py                                    start a service (help texts of its limits: limit_options.py)
    submit.py, scene_file.py                    send a scene with the files it refers to, and create a job
    jobs.py                                     show jobs, follow them, download their pictures; cancel, pause, resume, retry
    admin.py                                    jobs of all tenants, workers, usage, quotas
    farm.py                                     nodes of a Ray cluster and what runs there, without a service
    ../live/command.py                          show a stage in a browser
    ../agents/command.py                        show stages to agents
    keys.py                                     API keys: over HTTP, or in a data directory for the first one
    connection.py, exits.py, job_text.py        server and key; exit codes; a job in words

stdout is for results (ids, names of files, tables, JSON lines), stderr for everything else. Nothing heavy is imported before a
command runs.
"""

from __future__ import annotations

COMMANDS = {
    "serve": ("primray_service.cli.serve:serve", "Start a render service."),
    "submit": ("primray_service.cli.submit:submit", "Send a scene to a render service."),
    "status": ("primray_service.cli.jobs:status", "Show a service's jobs, or one job."),
    "watch": ("primray_service.cli.jobs:watch", "Follow a job until it has ended."),
    "fetch": ("primray_service.cli.jobs:fetch", "Download a job's files."),
    "cancel": ("primray_service.cli.jobs:cancel", "Cancel jobs; their pictures so far are kept."),
    "pause": ("primray_service.cli.jobs:pause", "Pause jobs and free their workers."),
    "resume": ("primray_service.cli.jobs:resume", "Resume paused jobs."),
    "retry": ("primray_service.cli.jobs:retry", "Render frames of a job again."),
    "view": ("primray_service.live.command:view", "Show a stage in a browser."),
    "mcp": ("primray_service.agents.command:mcp", "Show stages to agents, by the Model Context Protocol."),
    "farm": ("primray_service.cli.farm:farm", "Show a Ray cluster's nodes and running chunks."),
    "keys": ("primray_service.cli.keys:keys", "Make, list and revoke API keys."),
    "admin": ("primray_service.cli.admin:admin", "Administer a service: jobs of all tenants, workers, quotas."),
}
