"""What is allowed: of one upload, one job, one worker and one tenant. `primray serve` can change each; /v1/capabilities
tells."""

from __future__ import annotations

import os
from dataclasses import dataclass

KiB, MiB, GiB = 2**10, 2**20, 2**30


def _memory_bytes() -> int:
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


@dataclass(frozen=True)
class Limits:
    # An upload
    upload_bytes: int = 2 * GiB
    unpacked_bytes: int = 8 * GiB
    unpack_ratio: float = 200.0  # of unpacked to packed bytes, a member's and the package's; counted from 1 MiB unpacked on
    package_entries: int = 20_000
    path_bytes: int = 1024
    usdz_depth: int = 2
    upload_idle_s: float = 60.0  # between two pieces of a body
    manifest_bytes: int = 8 * MiB  # of a package's list of files, as JSON
    content_kept_s: float = 24 * 3600.0  # a file that arrived, and that no scene has
    # A request
    json_bytes: int = 256 * KiB
    labels: int = 32
    label_chars: int = 256
    wait_s: float = 60.0  # Prefer: wait
    page_items: int = 200
    # A job
    image_side: int = 32_768
    image_pixels: int = 2**26
    samples: int = 2**20
    seconds: float = 24 * 3600.0
    frames: int = 10_000
    ttl_s: float = 90 * 24 * 3600.0
    default_ttl_s: float = 7 * 24 * 3600.0
    # A scene, as its check and its render meet it
    layers: int = 2_000
    prim_depth: int = 1_000
    texture_bytes: int = 1 * GiB  # one image, decoded
    instances: int = 50_000_000  # expanded
    check_cpu_s: float = 60.0
    load_cpu_s: float = 60.0  # of a render, before its first sample
    # A worker
    memory_bytes: int = min(int(0.6 * _memory_bytes()), 64 * GiB)
    output_bytes: int = 8 * GiB
    log_bytes: int = 1 * MiB
    stop_grace_s: float = 5.0  # between asking a worker to stop and killing it
    crashes: int = 2  # of a frame without a checkpoint between them
    kills: int = 50
    checkpoint_every_s: float = 10.0
    scene_kept_s: float = (
        60.0  # a worker waits so long, with its scene open, for more of the tenant's jobs on it; 0: it does not
    )
    time_slice_s: float = 20.0  # before a frame gives way to another tenant's
    # The machine
    free_disk_bytes: int = 512 * MiB


@dataclass(frozen=True)
class Quotas:
    """A tenant's; None: no limit."""

    requests_per_s: float | None = 50.0
    burst: int = 200
    queued_jobs: int | None = 20_000
    running_jobs: int | None = None
    stored_bytes: int | None = 100 * GiB
    cpu_s_per_day: float | None = None
