"""A job request's webhook as it is stored with the job, and as it is shown."""

from __future__ import annotations

from ..api.models import Webhook
from ..config import ServeConfig
from ..jobs import Json
from ..problems import Problem
from .addresses import Resolve, check_address, resolve_now
from .signing import key_of, new_secret


def accepted_webhook(webhook: Webhook, config: ServeConfig, resolve: Resolve = resolve_now) -> Json:
    """Return the webhook to store: with a secret, made if none was given. Problem if it cannot be called. Call it in a thread:
    it resolves a name."""
    check_address(webhook.url, config, resolve)
    if webhook.secret is not None:
        try:
            key_of(webhook.secret)
        except ValueError as error:
            raise Problem("invalid-request", str(error), errors=[{"at": "/webhook/secret", "detail": str(error)}]) from None
    return {"url": webhook.url, "events": list(webhook.events), "secret": webhook.secret or new_secret()}


def shown_webhook(kept: Json, *, with_secret: bool = False) -> Json:
    """Return a stored webhook as clients see it; the secret only in the answer to the request that made it."""
    return {name: value for name, value in kept.items() if name != "secret" or with_secret}
