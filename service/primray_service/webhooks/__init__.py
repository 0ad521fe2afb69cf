"""Webhooks: calls to a client's own address when something happens to a job, by the scheme of standardwebhooks.com (1.0.0).

addresses.py   which addresses may be called: refused when a job is submitted, and again when it is connected to
signing.py     secrets and signatures
delivery.py    one try: connect to the address that was checked, send, read a little
sender.py      what is due, again and again; run by the server that holds the lease
acceptance.py  a job request's webhook, as it is kept with the job
"""

from __future__ import annotations

from .acceptance import accepted_webhook, shown_webhook
from .addresses import check_address
from .sender import WebhookSender
from .signing import new_secret

__all__ = ["WebhookSender", "accepted_webhook", "check_address", "new_secret", "shown_webhook"]
