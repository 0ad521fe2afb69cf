"""Limits of uploads, jobs, workers and tenants. `primray serve` can change each; /v1/capabilities reports them."""

from __future__ import annotations

import os
from dataclasses import dataclass

KiB, MiB, GiB = 2**10, 2**20, 2**30


def _memory_bytes() -> int:
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


@dataclass(frozen=True)
class Limits:
    # Upload
    upload_bytes: int = 2 * GiB
    unpacked_bytes: int = 8 * GiB
    # ratio of unpacked to packed bytes, of a member and of the package; applies from 1 MiB unpacked
    unpack_ratio: float = 200.0
    package_entries: int = 20_000
    path_bytes: int = 1024
    usdz_depth: int = 2
    upload_idle_s: float = 60.0  # between two blocks of a body
    manifest_bytes: int = 8 * MiB  # JSON list of a package's files
    content_kept_s: float = 24 * 3600.0  # uploaded files that belong to no scene
    # Request
    json_bytes: int = 256 * KiB
    labels: int = 32
    label_chars: int = 256
    wait_s: float = 60.0  # longest Prefer: wait
    page_items: int = 200
    # Job
    image_side: int = 32_768
    image_pixels: int = 2**26
    samples: int = 2**20
    seconds: float = 24 * 3600.0
    frames: int = 10_000
    ttl_s: float = 90 * 24 * 3600.0
    default_ttl_s: float = 7 * 24 * 3600.0
    # Scene, in its check and its renders
    layers: int = 2_000
    prim_depth: int = 1_000
    texture_bytes: int = 1 * GiB  # one decoded image
    instances: int = 50_000_000  # after expansion of instancing
    check_cpu_s: float = 60.0
    load_cpu_s: float = 60.0  # until a render's first sample
    explain_cpu_s: float = 120.0  # of an explained pixel, with what reading its scene takes
    # Worker
    memory_bytes: int = min(int(0.6 * _memory_bytes()), 64 * GiB)
    output_bytes: int = 8 * GiB
    log_bytes: int = 1 * MiB
    stop_grace_s: float = 5.0  # between asking a worker to stop and killing it
    crashes: int = 2  # of a frame, since its last checkpoint
    kills: int = 50
    checkpoint_every_s: float = 10.0
    scene_kept_s: float = 60.0  # a worker keeps its scene open this long for more of the tenant's jobs on it; 0: not at all
    time_slice_s: float = 20.0  # until a frame may be preempted for another tenant's
    # Machine
    free_disk_bytes: int = 512 * MiB


@dataclass(frozen=True, kw_only=True)
class Quotas:
    """Quotas of a tenant; None: no limit."""

    requests_per_s: float | None = 50.0
    burst: int = 200
    queued_jobs: int | None = 20_000
    running_jobs: int | None = None
    stored_bytes: int | None = 100 * GiB
    cpu_s_per_day: float | None = None
