"""`primray admin`: jobs of all tenants, workers, usage and quotas, with an administrator's key."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from itertools import islice
from typing import TYPE_CHECKING, Annotated

import typer

from primray.cli.console import print_line

from .connection import Json, KeyFile, Labels, Server, connected, labels_of
from .exits import USAGE, CommandError
from .job_text import block, percent_text, place_text, plain, seconds_text, state_text
from .jobs import JobId, JobIds, print_job
from .limit_options import quota_of

if TYPE_CHECKING:
    from ..client import Job as JobDocument
    from ..client import TenantUsage, Workers
    from ..client.documents import QuotaChanges, Share

admin = typer.Typer(
    help="Administer a service: jobs of all tenants, workers, usage, quotas.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

NO_LIMIT = "none"
Tenant = Annotated[str | None, typer.Option("--tenant", metavar="NAME", help="Only this tenant.", show_default=False)]
Limit = Annotated[str | None, typer.Option(metavar="N|none", show_default=False)]


@admin.command()
def jobs(
    tenant: Tenant = None,
    state: Annotated[str | None, typer.Option(metavar="STATE", help="Only jobs in this state.", show_default=False)] = None,
    count: Annotated[int, typer.Option("--count", "-n", metavar="N", help="Number of jobs, newest first.", min=1)] = 50,
    label: Labels = None,
    server: Server = None,
    key_file: KeyFile = None,
    json: Json = False,
) -> None:
    """List jobs of all tenants, newest first."""
    with connected("admin jobs", server, key_file) as client:
        labels = labels_of(label)
        if json:
            for document in islice(client.admin.documents(tenant=tenant, state=state, labels=labels), count):
                print_line({"type": "job", **document})
            return
        rows: list[tuple[str, ...]] = [("JOB", "TENANT", "STATE", "PRIORITY", "DONE", "QUEUE", "NAME")]
        rows += [_row(job) for job in islice(client.admin.jobs(tenant=tenant, state=state, labels=labels), count)]
    _print_table(rows)


def _row(job: JobDocument) -> tuple[str, ...]:
    words = (plain(job.id), plain(job.tenant), state_text(job), str(job.priority), percent_text(job.progress))
    return (*words, place_text(job.queue), plain(job.name or ""))


@admin.command()
def job(job: JobId, server: Server = None, key_file: KeyFile = None) -> None:
    """Show one job of any tenant."""
    with connected("admin job", server, key_file) as client:
        found = client.admin.job(job)
    print("\n".join([f"tenant    {plain(found.tenant)}", *block(found, [])]))


@admin.command()
def cancel(jobs: JobIds, server: Server = None, key_file: KeyFile = None, json: Json = False) -> None:
    """Cancel jobs of any tenant; the pictures rendered so far are kept."""
    with connected("admin cancel", server, key_file) as client:
        for job_id in jobs:
            print_job(client.admin.cancel(job_id).state, job_id, json)


@admin.command()
def pause(jobs: JobIds, server: Server = None, key_file: KeyFile = None, json: Json = False) -> None:
    """Pause jobs of any tenant."""
    with connected("admin pause", server, key_file) as client:
        for job_id in jobs:
            print_job(client.admin.pause(job_id).state, job_id, json)


@admin.command()
def resume(jobs: JobIds, server: Server = None, key_file: KeyFile = None, json: Json = False) -> None:
    """Resume paused jobs of any tenant."""
    with connected("admin resume", server, key_file) as client:
        for job_id in jobs:
            print_job(client.admin.resume(job_id).state, job_id, json)


@admin.command()
def retry(
    job: JobId,
    frame: Annotated[int, typer.Option("--frame", metavar="N", help="The frame's index in the job, from 0.")],
    server: Server = None,
    key_file: KeyFile = None,
    json: Json = False,
) -> None:
    """Render one frame of a job of any tenant again."""
    with connected("admin retry", server, key_file) as client:
        print_job(client.admin.retry_frame(job, frame).state, job, json, frame=frame)


@admin.command()
def priority(
    priority: Annotated[int, typer.Argument(metavar="PRIORITY", help="0 to 100; higher goes first.", min=0, max=100)],
    jobs: JobIds,
    server: Server = None,
    key_file: KeyFile = None,
    json: Json = False,
) -> None:
    """Change the priority of jobs of any tenant."""
    with connected("admin priority", server, key_file) as client:
        for job_id in jobs:
            changed = client.admin.change(job_id, priority=priority)
            if json:
                print_line({"type": "job", "id": job_id, "state": changed.state, "priority": changed.priority})
            else:
                print(f"{job_id} has priority {changed.priority}")


@admin.command()
def workers(server: Server = None, key_file: KeyFile = None, json: Json = False) -> None:
    """List the nodes where renders run, and the running frames."""
    with connected("admin workers", server, key_file) as client:
        if json:
            print_line({"type": "workers", **client.admin.workers_document()})
            return
        found = client.admin.workers()
    print("\n".join(_workers_lines(found)))


def _workers_lines(found: Workers) -> list[str]:
    head = f"{found.slots} slots, {found.cores} cores"
    if found.dispatcher == "nowhere":
        head += "; no server is dispatching"
    nodes = [("NODE", "SLOTS", ""), *((plain(node.id), str(node.slots), plain(node.why)) for node in found.nodes)]
    running = [("JOB", "FRAME", "TENANT", "PRIORITY", "DONE", "PHASE", "CPU", "NAME")]
    for each in found.running:
        done, cpu = f"{100 * each.fraction:.0f}%", seconds_text(each.cpu_s)
        words = (plain(each.job), str(each.frame), plain(each.tenant), str(each.priority), done, each.phase, cpu)
        running.append((*words, plain(each.name or "")))
    return [head, *_lines(nodes), "", *_lines(running)]


@admin.command()
def usage(tenant: Tenant = None, server: Server = None, key_file: KeyFile = None, json: Json = False) -> None:
    """List each tenant's usage and quotas."""
    with connected("admin usage", server, key_file) as client:
        found = list(client.admin.tenants()) if tenant is None else [client.admin.tenant(tenant)]
    if json:
        for each in found:
            print_line({"type": "tenant", **_json_of(each)})
    else:
        _print_table([("TENANT", "WAIT", "RUN", "STORED", "CPU s TODAY", "CPU s IN ALL", "SET"), *map(_usage_row, found)])


def _json_of(tenant: TenantUsage) -> dict[str, object]:
    from dataclasses import asdict

    return asdict(tenant)


def _usage_row(tenant: TenantUsage) -> tuple[str, ...]:
    set_here = " ".join(f"{name}={NO_LIMIT if value is None else value}" for name, value in tenant.quotas_set.items())
    return (
        plain(tenant.tenant),
        _share(tenant.queued_jobs),
        _share(tenant.running_jobs),
        _share(tenant.stored_bytes),
        _share(tenant.cpu_s_per_day),
        f"{tenant.cpu_s_total:,.0f}",
        plain(set_here),
    )


def _share(share: Share) -> str:
    return f"{share.used:,.0f}" + ("" if share.limit is None else f" of {share.limit:,.0f}")


@admin.command()
def quotas(
    tenant: Annotated[str, typer.Argument(metavar="TENANT", help="The tenant.", show_default=False)],
    running_jobs: Limit = None,
    queued_jobs: Limit = None,
    stored_bytes: Limit = None,
    cpu_s_per_day: Limit = None,
    requests_per_s: Limit = None,
    unset: Annotated[
        bool, typer.Option("--unset", help="Remove the quotas that were set; those of its keys apply again.")
    ] = False,
    server: Server = None,
    key_file: KeyFile = None,
    json: Json = False,
) -> None:
    """Set a tenant's quotas, overriding its keys', or show them; `none` is no limit, 3M and 2h are values with units."""
    asked = {
        "running_jobs": running_jobs,
        "queued_jobs": queued_jobs,
        "stored_bytes": stored_bytes,
        "cpu_s_per_day": cpu_s_per_day,
        "requests_per_s": requests_per_s,
    }
    changes: QuotaChanges = {}
    for name, text in asked.items():
        if text is not None:
            changes[name] = quota_of(name, text)  # type: ignore[literal-required]
    if unset and changes:
        raise CommandError("quotas", "--unset cannot be combined with other quotas", USAGE)
    with connected("admin quotas", server, key_file) as client:
        if changes and all(each.tenant != tenant for each in client.admin.tenants()):
            note = "has no key, scene or job yet; the quotas will apply once it has (--unset removes them)"
            print(f"note: a tenant {plain(tenant)} {note}", file=sys.stderr)
        if unset:
            found = client.admin.unset_quotas(tenant)
        else:
            found = client.admin.set_quotas(tenant, changes) if changes else client.admin.tenant(tenant)
    if json:
        print_line({"type": "tenant", **_json_of(found)})
        return
    for name, value in found.quotas.items():
        mark = "  set by an administrator" if name in found.quotas_set else ""
        print(f"{name:15} {NO_LIMIT if value is None else f'{value:,}'}{mark}")


def _lines(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def _print_table(rows: Sequence[Sequence[str]]) -> None:
    print("\n".join(_lines(rows)))
