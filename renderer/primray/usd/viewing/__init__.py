"""Which camera looks, how large its picture is, and what moves while its shutter is open."""
