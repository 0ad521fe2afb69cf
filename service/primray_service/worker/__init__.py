"""The program that runs one chunk in its sandbox: `python -m primray_service.worker`. protocol.py is its protocol."""
