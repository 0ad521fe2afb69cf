"""Webhooks: calls of a client's own address about events of a job, by the scheme of standardwebhooks.com (1.0.0).

addresses.py   which addresses may be called: checked when a job is submitted, and again at each connection
signing.py     secrets and signatures
sender.py      loop over due deliveries, run by the server that holds the lease; one attempt: connect to the checked address
"""

from __future__ import annotations

from .addresses import accepted_webhook, check_address, shown_webhook
from .sender import WebhookSender
from .signing import new_secret

__all__ = ["WebhookSender", "accepted_webhook", "check_address", "new_secret", "shown_webhook"]
